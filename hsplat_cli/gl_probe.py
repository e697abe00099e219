"""Tests whether OpenGL without a screen works: exit status 0, or 1 and one line on the standard error stream.

Uses the standard library alone, because it runs before anything is installed, in Python 3.6 too. It is a separate
process, because a broken driver may crash. Like moderngl it opens EGL, a device, and its display.
"""

import ctypes
import sys

_EGL_PLATFORM_DEVICE = 0x313F
_MAX_DEVICES = 16


def main() -> int:
    """Print the problem, if any, and return the exit status."""
    problem = find_problem()
    if problem:
        print(problem, file=sys.stderr)
    return 1 if problem else 0


def find_problem() -> str:
    """Return what is missing, or an empty string."""
    try:
        ctypes.CDLL("libGL.so.1")
        egl = ctypes.CDLL("libEGL.so.1")
    except OSError as error:
        return str(error)
    egl.eglGetProcAddress.restype = ctypes.c_void_p
    query_devices = egl.eglGetProcAddress(b"eglQueryDevicesEXT")
    get_display = egl.eglGetProcAddress(b"eglGetPlatformDisplayEXT")
    if not query_devices or not get_display:
        return "libEGL.so.1 is too old: it cannot list devices"
    devices, num_devices = (ctypes.c_void_p * _MAX_DEVICES)(), ctypes.c_int(0)
    # Prototypes: EGLBoolean (EGLint max, EGLDeviceEXT *devices, EGLint *num) and
    # EGLDisplay (EGLenum platform, void *native_display, const EGLint *attributes).
    query = ctypes.CFUNCTYPE(ctypes.c_uint, ctypes.c_int, ctypes.c_void_p, ctypes.c_void_p)(query_devices)
    display_of = ctypes.CFUNCTYPE(ctypes.c_void_p, ctypes.c_uint, ctypes.c_void_p, ctypes.c_void_p)(get_display)
    query(_MAX_DEVICES, ctypes.addressof(devices), ctypes.addressof(num_devices))
    egl.eglInitialize.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_void_p]
    displays = [display_of(_EGL_PLATFORM_DEVICE, device, None) for device in devices[: num_devices.value]]
    if any(display and egl.eglInitialize(display, None, None) for display in displays):
        return ""
    return f"EGL has no driver that works (devices found: {num_devices.value})"


if __name__ == "__main__":
    sys.exit(main())
