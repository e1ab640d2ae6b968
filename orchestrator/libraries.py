"""What libraries must be told before they are imported: where to write, and that nothing is drawn.

Some write below HOME, into their own installation or under TMPDIR. Where that cannot be done, they
get a folder of ours in a temporary place instead.
"""

from __future__ import annotations

import os
import secrets
import stat
import tempfile
from importlib.util import find_spec
from pathlib import Path

from analysis.backends import CHOSEN
from analysis.files import can_write, existing_above
from orchestrator.errors import UsageError

LONGEST = 32  # characters of Ray's folder: the names of its sockets have 107 at most


def set_drawing_aside() -> None:
    """MuJoCo loads a library to draw with when it is imported, and no command draws by itself.

    Pictures are drawn by processes of their own, which get what the user has chosen.
    """
    if chosen := os.environ.get("MUJOCO_GL"):
        os.environ.setdefault(CHOSEN, chosen)
    os.environ["MUJOCO_GL"] = "disable"


def give_places() -> None:
    """Say to matplotlib and numba where to write, if they cannot where they usually do.

    Where no temporary place can be written to either, they are left to do what they can.
    """
    needed = {}
    if not matplotlib_can_write():
        needed["MPLCONFIGDIR"] = "matplotlib"
    if not numba_can_write():
        needed["NUMBA_CACHE_DIR"] = "numba"
    for variable, name in needed.items():
        try:
            os.environ[variable] = str(own_folder() / name)
        except UsageError:
            return


def matplotlib_can_write() -> bool:
    """Settings and fonts that it has found; elsewhere it warns, and looks for fonts each time."""
    if named := os.environ.get("MPLCONFIGDIR"):
        return could_write(Path(named))
    return all(could_write(folder / "matplotlib") for folder in (_below_home("CONFIG"), _cache()))


def numba_can_write() -> bool:
    """Code that it has compiled for robosuite, which cannot be imported elsewhere."""
    try:
        robosuite = find_spec("robosuite")
    except ModuleNotFoundError:  # of who hides what is installed
        return True
    if robosuite is None or robosuite.origin is None:
        return True
    installed = Path(robosuite.origin).parent / "utils" / "__pycache__"
    named = os.environ.get("NUMBA_CACHE_DIR")
    return any(could_write(folder) for folder in (Path(named or installed), _cache() / "numba"))


def ray_folder() -> str | None:
    """Where Ray is to keep its sockets and logs; None: where it does by itself.

    Raises UsageError where there is no place for them.
    """
    usual = Path(os.environ.get("RAY_TMPDIR") or os.environ.get("TMPDIR") or "/tmp", "ray")
    if len(str(usual)) <= LONGEST and could_write(usual):
        return None
    return str(own_folder(LONGEST - len("/ray")) / "ray")


def give_ray_a_token() -> None:
    """Ray writes one to HOME before it starts here, if it finds none. One is enough for a run."""
    if "RAY_AUTH_TOKEN" not in os.environ and not could_write(home() / ".ray" / "auth_token"):
        os.environ["RAY_AUTH_TOKEN"] = secrets.token_hex(32)


def own_folder(longest: int | None = None) -> Path:
    """This user's folder in a temporary place, made if it is not there, and closed to others.

    Raises UsageError where there is none whose name has at most `longest` characters.
    """
    for place in _temporary_places():
        folder = _own_folder_in(place)
        if (longest is None or len(str(folder)) <= longest) and _is_own(folder):
            return folder
    short = "" if longest is None else f" and whose name has at most {longest} characters"
    raise UsageError(f"no temporary folder can be written to: set TMPDIR to one that can be{short}")


def is_temporary(folder: Path) -> bool:
    """Whether it is in an `own_folder`."""
    return folder.parent in [_own_folder_in(place) for place in _temporary_places()]


def _own_folder_in(place: Path) -> Path:
    return place / f"skillstitch-{os.getuid()}"


def _temporary_places() -> list[Path]:
    try:
        usual = [Path(tempfile.gettempdir())]
    except FileNotFoundError:
        usual = []
    return [*usual, Path("/tmp"), Path("/dev/shm")]


def _is_own(folder: Path) -> bool:
    """Compiled code is kept there, so nobody else may have made it, or may write to it."""
    try:
        folder.mkdir(mode=0o700, exist_ok=True)
        found = folder.lstat()
    except OSError:
        return False
    closed = stat.S_ISDIR(found.st_mode) and not stat.S_IMODE(found.st_mode) & 0o077
    return closed and found.st_uid == os.getuid() and can_write(folder)


def could_write(path: Path) -> bool:
    """Whether a file or folder could be made there, with folders above it."""
    try:
        existing = existing_above(path)
    except OSError:
        return False
    return os.access(existing, os.W_OK) if existing.is_file() else can_write(existing)


def home() -> Path:
    """HOME, or that of the user's account; a folder that is not there where neither is known."""
    try:
        return Path.home()
    except RuntimeError:
        return Path("/nonexistent")


def _cache() -> Path:
    return _below_home("CACHE")


def _below_home(kind: str) -> Path:
    """The folder that the XDG standard has for a kind of files."""
    return Path(os.environ.get(f"XDG_{kind}_HOME") or home() / f".{kind.lower()}")
