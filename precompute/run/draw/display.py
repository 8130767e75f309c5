"""An X display for VTK."""
import atexit
import ctypes
import os
import shutil
import signal
import subprocess
import time

from common import SystemError_


def start_server():
    """Starts Xvfb on a free display from :100 on, since some programs (hwloc in Open MPI) probe :0 to :9. Returns its number or None."""
    first = 100 + os.getpid() % 900
    for number in range(first, first + 20):
        read_end, write_end = os.pipe()
        server = subprocess.Popen(
            ["Xvfb", f":{number}", "-displayfd", str(write_end), "-screen", "0", "1280x1024x24", "-nolisten", "tcp", "-noreset"],
            pass_fds=[write_end],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            preexec_fn=lambda: ctypes.CDLL(None).prctl(1, signal.SIGTERM),
        )  # PR_SET_PDEATHSIG: it ends with this process
        os.close(write_end)
        with os.fdopen(read_end) as pipe:
            if pipe.readline().strip():
                atexit.register(lambda: (server.terminate(), server.wait()))
                return number
        server.wait()
    return None


def open_display():
    """Debian's VTK draws through X: starts a virtual server that ends with this process."""
    if shutil.which("Xvfb") is None:
        if os.environ.get("DISPLAY"):
            return
        raise SystemError_("Xvfb is missing, and there is no display; install the package xvfb")
    number = start_server()
    if number is None:
        raise SystemError_("the virtual display Xvfb did not start; run 'Xvfb :99' to see why")
    # VTK exits when it cannot connect, so Xlib tries first.
    x11 = ctypes.CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XCloseDisplay.argtypes = [ctypes.c_void_p]
    for _ in range(100):
        display = x11.XOpenDisplay(f":{number}".encode())
        if display:
            x11.XCloseDisplay(display)
            os.environ["DISPLAY"] = f":{number}"
            return
        time.sleep(0.1)
    raise SystemError_(f"the virtual display :{number} accepts no connections; is /tmp/.X11-unix writable for everybody?")
