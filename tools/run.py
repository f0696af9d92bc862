#!/usr/bin/env python3
"""Set raytide up and run it. Needs Python >= 3.11 with venv, nothing else.

    python3 tools/run.py render scenes/cornell/cornell.toml -o cornell.exr
    python3 tools/run.py test                 the whole suite, in two processes
    python3 tools/run.py test [pytest arguments]
    python3 tools/run.py COMMAND ...          any other raytide command
    python3 tools/run.py python FILE ...      a developer's tool, in the same environment

The first use makes .venv beside pyproject.toml and installs raytide in it; later uses start at once.
"""

import os
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
VENV = os.path.join(ROOT, ".venv")
PYTHON = os.path.join(VENV, "Scripts", "python.exe") if os.name == "nt" else os.path.join(VENV, "bin", "python")
STAMP = os.path.join(VENV, "raytide.stamp")
LOG = os.path.join(VENV, "install.log")
# Kernels compile on one thread each, which leaves a core idle; whole files share a process, and so their programs.
WHOLE_SUITE = ["-n", "2", "--dist", "loadfile"]
# What pip prints when it cannot reach an index.
OFFLINE = ("NewConnectionError", "name resolution", "Connection refused", "ConnectionError", "Max retries", "timed out")


def main(arguments):
    if sys.version_info < (3, 11):
        return fail(f"raytide needs Python 3.11 or newer; this is {sys.version.split()[0]} at {sys.executable}")
    if not arguments or arguments[0] in ("-h", "--help"):
        print(__doc__.strip(), file=sys.stdout if arguments else sys.stderr)
        return 0 if arguments else 2
    stamp = wanted_stamp()
    if read(STAMP) != stamp or not os.path.exists(PYTHON):
        problem = set_up(stamp)
        if problem:
            return fail(problem)
    if arguments[0] == "test":
        os.chdir(ROOT)
        return start(["-P", "-m", "pytest", *(arguments[1:] or WHOLE_SUITE)])
    if arguments[0] == "python":
        return start(arguments[1:])
    return start(["-P", "-m", "raytide", *arguments])  # -P: a file of the working folder never shadows a module


def wanted_stamp():
    """What the environment must have been made from: the dependencies, and the place (an editable install knows it)."""
    import hashlib

    digest = hashlib.sha256(read(os.path.join(ROOT, "pyproject.toml")))
    digest.update(ROOT.encode())
    return digest.hexdigest().encode()


def set_up(stamp):
    """Make the environment; one line that says what is wrong, or None. Safe against a second process doing the same."""
    lock = hold_lock()
    try:
        if read(STAMP) == stamp and os.path.exists(PYTHON):  # another process made it while this one waited
            return None
        return make_venv() or install() or write(STAMP, stamp)
    finally:
        if lock:
            lock.close()


def make_venv():
    import importlib.util
    import subprocess

    if not all(importlib.util.find_spec(name) for name in ("venv", "ensurepip")):
        package = f"python3.{sys.version_info[1]}-venv"
        return f"Python's venv is missing; install it (Debian, Ubuntu: sudo apt install {package}) and run again"
    if usable():
        return None
    say("first use: making .venv")
    made = subprocess.run([sys.executable, "-m", "venv", "--clear", VENV], capture_output=True, text=True)
    if made.returncode:
        return f"could not make {VENV}: {last_line(made.stdout + made.stderr)}"
    return None


def usable():
    """Whether .venv is there, has pip and is new enough; which interpreter made it does not matter."""
    import subprocess

    question = "import pip, sys; sys.exit(sys.version_info < (3, 11))"
    try:
        return subprocess.run([PYTHON, "-c", question], capture_output=True).returncode == 0
    except OSError:
        return False


def install():
    """`pip install -e .[report,dev]`, its output in a log and one moving line on stderr."""
    import subprocess

    command = [PYTHON, "-m", "pip", "install", "--disable-pip-version-check", "--progress-bar", "off", "--retries", "2"]
    command += ["--timeout", "20", "-e", ROOT + "[report,dev]"]
    say("installing raytide and what it needs in .venv")
    lines = []
    with open(LOG, "w", encoding="utf-8") as log:
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.STDOUT}
        process = subprocess.Popen(command, encoding="utf-8", errors="replace", **pipes)
        for line in process.stdout:
            log.write(line)
            lines.append(line.strip())
            moving(lines[-1])
    moving("")
    if process.wait() == 0:
        say("ready")
        return None
    if any(word in line for line in lines for word in OFFLINE):
        return f"no network: the first use fetches what raytide needs from PyPI; connect and run again (log: {LOG})"
    errors = [line for line in lines if "error" in line.lower()] or lines
    return f"installation failed: {last_line(os.linesep.join(errors))} (log: {LOG})"


def start(arguments):
    """Become the environment's Python, so that exit codes and signals are its own."""
    command = [PYTHON, *arguments]
    if os.name != "nt":
        sys.stdout.flush()
        sys.stderr.flush()
        os.execv(PYTHON, command)
    import signal
    import subprocess

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the child gets Ctrl-C too, and decides
    return subprocess.call(command)


def hold_lock():
    """An exclusive lock on this very file, or None where the system has no flock."""
    try:
        import fcntl
    except ImportError:
        return None
    lock = open(os.path.abspath(__file__), "rb")
    try:
        fcntl.flock(lock, fcntl.LOCK_EX)
    except OSError:  # a file system without locks
        pass
    return lock


def read(path):
    try:
        with open(path, "rb") as file:
            return file.read()
    except OSError:
        return b""


def write(path, data):
    with open(path, "wb") as file:
        file.write(data)


def last_line(text):
    return (text.strip().splitlines() or ["no reason given"])[-1]


def say(text):
    print("raytide: " + text, file=sys.stderr, flush=True)


def moving(text):
    if sys.stderr.isatty():
        print("\r\x1b[K" + text[:78], end="", file=sys.stderr, flush=True)


def fail(text):
    say(text)
    return 1


if __name__ == "__main__":
    try:
        sys.exit(main(sys.argv[1:]))
    except KeyboardInterrupt:
        sys.exit(130)
