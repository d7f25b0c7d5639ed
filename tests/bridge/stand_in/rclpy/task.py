import inspect
import threading


class Future:
    """Done callbacks and awaiting coroutines run in the executor; completing a future does not wake it."""

    def __init__(self, *, executor=None):
        self._executor = executor
        self._done = False
        self._result = None
        self._exception = None
        self._callbacks = []
        self._lock = threading.Lock()

    def __await__(self):
        while not self._done:
            yield
        return self.result()

    def done(self):
        return self._done

    def result(self):
        if self._exception is not None:
            raise self._exception
        return self._result

    def exception(self):
        return self._exception

    def set_result(self, result):
        self._end(result, None)

    def set_exception(self, exception):
        self._end(None, exception)

    def add_done_callback(self, callback):
        with self._lock:
            if not self._done:
                self._callbacks.append(callback)
                return
        self._call([callback])

    def _end(self, result, exception):
        with self._lock:
            self._result, self._exception, self._done = result, exception, True
            callbacks, self._callbacks = self._callbacks, []
        self._call(callbacks)

    def _call(self, callbacks):
        for callback in callbacks:
            if self._executor is None:
                callback(self)
            else:
                self._executor.create_task(callback, self)


class Task(Future):
    """Made by executors only."""

    def __init__(self, handler, args, kwargs, executor, ended=None):
        super().__init__(executor=executor)
        self._handler = handler(*args, **kwargs) if inspect.iscoroutinefunction(handler) else handler
        self._args, self._kwargs = args, kwargs
        self._ended = ended

    def __call__(self):
        try:
            if inspect.iscoroutine(self._handler):
                self._handler.send(None)
                return
            self.set_result(self._handler(*self._args, **self._kwargs))
        except StopIteration as end:
            self.set_result(end.value)
        except Exception as error:
            self.set_exception(error)
        if self._ended is not None:
            self._ended()
