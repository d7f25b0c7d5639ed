class InvalidHandle(Exception):
    pass


class ParameterException(Exception):
    def __init__(self, error_msg, parameters, *args):
        super().__init__(error_msg, parameters, *args)


class ParameterAlreadyDeclaredException(ParameterException):
    def __init__(self, parameter):
        super().__init__("Parameter already declared", parameter)


class ParameterNotDeclaredException(ParameterException):
    def __init__(self, parameter):
        super().__init__("Invalid access to undeclared parameter(s)", parameter)


class InvalidParameterTypeException(ParameterException):
    def __init__(self, parameter, expected):
        super().__init__(f"Trying to set parameter '{parameter}' to a value that is not of type {expected}", parameter)


class ParameterUninitializedException(ParameterException):
    def __init__(self, parameter):
        super().__init__("The parameter(s) was not initialized", parameter)


class InvalidTopicNameException(Exception):
    pass
