"""One thread that sleeps until an entity has work, a task is created or a timer is due."""

import threading
import time
from collections import deque

from rclpy._context import context as _context
from rclpy.task import Task


class ExternalShutdownException(Exception):
    pass


class RCLError(RuntimeError):
    """In rclpy, a class of its C++ part that no module of rclpy exports."""


class SingleThreadedExecutor:
    def __init__(self, *, context=None):
        if context is not None:
            raise NotImplementedError
        self._awake = threading.Condition()
        self._tasks = []
        self._work = deque()
        self._timers = []
        self._nodes = []
        self._down = False
        self._spinning = None
        _context.on_shutdown(self._wake)

    def add_node(self, node):
        self._nodes.append(node)
        node._executor = self
        self._wake()
        return True

    def create_task(self, callback, *args, **kwargs):
        if self._down or not _context.ok:
            raise RuntimeError("cannot trigger a guard condition without a context")
        task = Task(callback, args, kwargs, self)
        with self._awake:
            self._tasks.append(task)
            self._awake.notify()
        return task

    def spin(self):
        if self._spinning is not None:
            raise RuntimeError("Executor is already spinning")
        self._spinning = threading.get_ident()
        try:
            while _context.ok and not self._down:
                self._spin_once()
        finally:
            self._spinning = None
        if not self._down:
            # The real one raises either, depending on where in its loop the context is taken away.
            if _context.signalled:
                raise RCLError("failed to initialize wait set: the given context is not valid")
            raise ExternalShutdownException

    def shutdown(self, timeout_sec=None):
        self._down = True
        self._wake()
        return True

    def _wake(self):
        with self._awake:
            self._awake.notify()

    def _submit(self, entity, callback, *args, then=None):
        """Queues the callback of an entity; called by the graph's thread."""
        with self._awake:
            self._work.append((entity, callback, args, then))
            self._awake.notify()

    def _spin_once(self):
        with self._awake:
            tasks = self._tasks[::-1]
        for task in tasks:
            self._run(task)
        with self._awake:
            self._tasks = [task for task in self._tasks if not task.done()]
            job = self._next_job()
            if job is None:
                new = len(self._tasks) > len([task for task in tasks if not task.done()])
                if _context.ok and not self._down and not new:
                    self._awake.wait(self._until_next_timer())
                return
        entity, callback, args, then = job
        group = entity.callback_group
        group._active += 1

        async def handle():
            try:
                result = callback(*args)
                if hasattr(result, "__await__"):
                    result = await result
                if then is not None:
                    then(result)
            finally:
                group._active -= 1

        task = Task(handle, (), {}, self)
        self._run(task)
        if not task.done():
            with self._awake:
                self._tasks.append(task)

    def _run(self, task):
        task()
        if task.done() and task.exception() is not None:
            raise task.exception()

    def _next_job(self):
        now = time.monotonic()
        for timer in self._timers:
            if timer.due <= now and timer.callback_group.can_execute():
                timer.due = max(timer.due + timer.period, now)
                return timer, timer.callback, (), None
        for i, job in enumerate(self._work):
            if job[0].destroyed:
                del self._work[i]
                return self._next_job()
            if job[0].callback_group.can_execute():
                del self._work[i]
                return job
        return None

    def _until_next_timer(self):
        if not self._timers:
            return None
        return max(min(timer.due for timer in self._timers) - time.monotonic(), 0.0)
