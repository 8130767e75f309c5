"""Linux namespaces in tests: a mount namespace of its own, as root, for root and for ordinary users."""
import os
import subprocess


def find_mount_namespace():
    """Words of unshare before the command that runs inside; None where namespaces are forbidden, as in many containers."""
    words = ["unshare", "--mount", "--propagation", "private", *([] if os.geteuid() == 0 else ["--map-root-user"])]
    return words if subprocess.run([*words, "true"], capture_output=True).returncode == 0 else None
