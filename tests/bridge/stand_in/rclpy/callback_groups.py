class CallbackGroup:
    def __init__(self):
        self._active = 0

    def can_execute(self):
        raise NotImplementedError


class ReentrantCallbackGroup(CallbackGroup):
    def can_execute(self):
        return True


class MutuallyExclusiveCallbackGroup(CallbackGroup):
    def can_execute(self):
        return self._active == 0
