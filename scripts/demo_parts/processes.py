"""Starting, watching and ending the demo's processes."""
import os
import pathlib
import signal
import socket
import subprocess
import sys
import time


class DemoError(Exception):
    """A fault in words for the user."""


def free_port():
    """A TCP port nobody listens on, for a ROS master of our own."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Process:
    """A child in its own process group with its output in a log file; ended with its children, never by name."""

    def __init__(self, command, log_path, env=None):
        self.command = [str(part) for part in command]
        self.log_path = pathlib.Path(log_path)
        self._log = open(self.log_path, "wb")
        self._child = subprocess.Popen(self.command, stdout=self._log, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                                       env=env, start_new_session=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.stop()

    def running(self):
        return self._child.poll() is None

    def check(self):
        if not self.running():
            raise DemoError(f"{os.path.basename(self.command[0])} ended early (exit code {self._child.returncode}); "
                            f"its last words, from {self.log_path}:\n{self.tail()}")

    def tail(self, lines=15):
        text = self.log_path.read_text(errors="replace").splitlines()
        return "\n".join("    " + line for line in text[-lines:])

    def stop(self, patience_s=15.0):
        for sign in (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            if not self.running():
                break
            try:
                os.killpg(self._child.pid, sign)
            except ProcessLookupError:
                break
            try:
                self._child.wait(patience_s)
            except subprocess.TimeoutExpired:
                continue
        self._log.close()


def run(command, log_path, env=None, show=False):
    """Runs a program to its end; DemoError with its last words if it fails. With show, its progress is seen."""
    command = [str(part) for part in command]
    with open(log_path, "wb") as log:
        result = subprocess.run(command, stdout=log, stderr=None if show else subprocess.STDOUT, env=env, check=False)
    if result.returncode != 0:
        text = pathlib.Path(log_path).read_text(errors="replace").splitlines()
        raise DemoError(f"{os.path.basename(command[0])} failed (exit code {result.returncode}):\n" +
                        "\n".join("    " + line for line in text[-15:]))


class ProgressLine:
    """One line that is rewritten on a terminal, and printed anew every few seconds elsewhere."""

    def __init__(self):
        self._terminal = sys.stdout.isatty()
        self._last = 0.0
        self._start = time.monotonic()

    def show(self, text):
        now = time.monotonic()
        if now - self._last < (0.5 if self._terminal else 10.0):
            return
        self._last = now
        line = f"[{now - self._start:4.0f} s] {text}"
        print(("\r\033[K" + line) if self._terminal else line, end="" if self._terminal else "\n", flush=True)

    def done(self, text):
        line = f"[{time.monotonic() - self._start:4.0f} s] {text}"
        print(("\r\033[K" if self._terminal else "") + line, flush=True)
