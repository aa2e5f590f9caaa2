"""Workers that are this process: tasks are done at once, for tests of what is done with them."""

from concurrent.futures import Executor, Future


class Here(Executor):
    """An executor, and the crew around it."""

    def __init__(self, width=2):
        self.executor, self.width = self, width

    def submit(self, function, *given):
        """Do a task."""
        done = Future()
        done.set_result(function(*given))
        return done

    def stop(self):
        """There is nothing to stop."""
