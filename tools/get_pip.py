"""Put pip into the virtual environment that runs this, using the standard library only.

For a Python without ``ensurepip`` (Debian's, when python3-venv is not installed). The wheel is
looked up in the package index that pip itself would use, and must have the checksum given here.
"""

import configparser
import hashlib
import os
import re
import ssl
import subprocess
import sys
import tempfile
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

WHEEL = "pip-25.3-py3-none-any.whl"
SHA256 = "9655943313a94722b7774661c21049070f6bbb0a1516bf02f7c8d5d9201514cd"


def pip_setting(name: str, default: str | None = None) -> str | None:
    """Return a setting from pip's environment variables or configuration files."""
    value = os.environ.get("PIP_" + name.upper().replace("-", "_"))
    if value:
        return value
    config = configparser.RawConfigParser()
    config_home = os.environ.get("XDG_CONFIG_HOME") or "~/.config"
    files = ["/etc/pip.conf", "~/.pip/pip.conf", config_home + "/pip/pip.conf"]
    files.append(os.environ.get("PIP_CONFIG_FILE") or "")
    config.read([Path(file).expanduser() for file in files if file])
    return config.get("global", name, fallback=default)


def fetch(url: str) -> bytes:
    """Return what is at ``url``.

    A bare system has no certificate authorities to check the server against. Then go on without:
    nothing secret is sent, and a wheel that is not the one named above is refused.
    """
    try:
        context = ssl.create_default_context(cafile=pip_setting("cert"))
        with urllib.request.urlopen(url, timeout=30, context=context) as answer:
            return bytes(answer.read())
    except urllib.error.URLError as error:
        if not isinstance(error.reason, ssl.SSLCertVerificationError):
            raise
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    with urllib.request.urlopen(url, timeout=30, context=context) as answer:
        return bytes(answer.read())


def main() -> int:
    """Fetch the wheel, check it and let it install itself."""
    index = (pip_setting("index-url") or "https://pypi.org/simple").rstrip("/") + "/pip/"
    try:
        links = re.findall(r'href="([^"]+)"', fetch(index).decode())
        link = next(link for link in links if WHEEL in link)
        wheel = fetch(urllib.parse.urljoin(index, link))
    except StopIteration:
        print(f"{index} has no {WHEEL}", file=sys.stderr)
        return 1
    except (OSError, ValueError) as error:
        print(f"could not fetch pip from {index}: {error}", file=sys.stderr)
        return 1
    if hashlib.sha256(wheel).hexdigest() != SHA256:
        print(f"{WHEEL} from {index} has the wrong checksum", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / WHEEL
        path.write_bytes(wheel)
        # pip runs from inside its own wheel: Python imports from zip files.
        install = [sys.executable, f"{path}/pip", "install", "--quiet", "--no-index", str(path)]
        return subprocess.run(install, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
