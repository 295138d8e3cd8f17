"""The compiler of inner loops: `kernel` has numba compile a plain loop at its first call and keep the machine code on disk.

A busy inner loop is written once, as a Python function of numbers and arrays in the module of its stage. numba is imported
when the first kernel is called, so that ``import rso_lidar`` stays fast. ``NUMBA_DISABLE_JIT=1`` runs kernels as Python,
for a debugger.

Machine code is kept in ``__pycache__`` of this package, else in the user's cache folder, else in a private folder among the
temporary files; ``NUMBA_CACHE_DIR`` names another place. numba notices a change of the file that holds a kernel. A change of
what the kernel takes from elsewhere (other kernels, constants) is noticed here: it gives the kernel another folder.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import stat
import tempfile
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache, cached_property, update_wrapper
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, ClassVar, TypeVar, cast

import numpy as np

from rso_lidar.errors import warn
from rso_lidar.user_settings import get_setting

_LONGEST_WAIT_S = 120.0  # a kernel takes at most some 3 s of one core, and a loaded machine may give a tenth of one

_Function = TypeVar("_Function", bound=Callable[..., Any])

_first_calls = threading.RLock()  # what a kernel calls back runs in the thread that holds it


def kernel(function: _Function) -> _Function:
    """Compile a loop at its first call: without the GIL, IEEE arithmetic in the order written.

    A kernel may call other kernels, and read numbers, tuples and arrays of its module or of an imported one. It is compiled
    once for each combination of argument types: pass `packed` arrays.
    """
    return cast(_Function, Kernel(function))


class Kernel:
    """A loop that is compiled at its first call."""

    all: ClassVar[list[Kernel]] = []

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        update_wrapper(self, function)
        self._dispatcher: Any = None
        self._has_run = False
        Kernel.all.append(self)

    def __call__(self, *arguments: Any) -> Any:
        """Run the loop."""
        if self._has_run:
            return self._dispatcher(*arguments)
        with _first_calls, _locked(_folder_of(self)):
            result = self._run_first(arguments)
            self._has_run = True
            return result

    def __reduce__(self) -> str:
        """Pickle by name, as functions are."""
        return self.function.__qualname__

    @property
    def dispatcher(self) -> Any:
        """What numba makes of this loop, with its machine code on disk where there is a place for it."""
        with _first_calls:
            if self._dispatcher is None:
                self._dispatcher = _dispatcher(self.function, _folder_of(self))
            return self._dispatcher

    @cached_property
    def _callee(self) -> Any:
        """What numba makes of this loop for other kernels; their machine code holds it, so it is not kept itself."""
        return _compiler(no_cpython_wrapper=True)(self.function)

    @property
    def _numba_type_(self) -> Any:
        """What numba takes this object for where another kernel calls it."""
        return self._callee._numba_type_

    def forget(self) -> None:
        """Compile anew at the next call, unless the loop has run."""
        if not self._has_run:
            self._dispatcher = None

    def _run_first(self, arguments: tuple[Any, ...]) -> Any:
        """Run the loop for the first time, and once more after each remedy for machine code that cannot be used."""
        from numba.core.errors import NumbaError

        for remedy in (_store.empty, _store.give_up):
            if _folder_of(self) is None:
                break
            try:
                return self.dispatcher(*arguments)
            except NumbaError:  # the loop itself is wrong
                raise
            except Exception as error:  # whatever unpickling and LLVM raise for a damaged file
                remedy(error)
        return self.dispatcher(*arguments)


def packed(values: np.ndarray, dtype: Any = None) -> np.ndarray:
    """Return values contiguous and read-only: a kernel is compiled once for each combination of those."""
    whole = np.ascontiguousarray(values, dtype).view()
    whole.setflags(write=False)
    return whole


def compiler_version() -> str:
    """Return the name and version of what compiles kernels, such as "numba 0.68.1"."""
    import numba

    return f"numba {numba.__version__}"


def has_machine_code(loop: Callable[..., Any]) -> bool | None:
    """Return whether a kernel, as it is now, has been compiled and kept on disk; None if nothing is kept."""
    folder = _folder_of(cast(Kernel, loop))
    return None if folder is None else any(folder.rglob("*.nbi"))


@contextmanager
def watch_compiling(tell: Callable[[int], None]) -> Iterator[None]:
    """Call `tell` inside this context when a kernel is compiled for the first time.

    Parameters
    ----------
    tell : called with the number of kernels compiled so far, this one included. How many will be is not known: machine code
        of others is on disk, or never needed
    """
    from numba.core import event

    compiled = set()

    class Compiled(event.Listener):
        def on_start(self, event: Any) -> None:
            function = event.data["dispatcher"].py_func
            if function not in compiled and any(kernel.function is function for kernel in Kernel.all):
                compiled.add(function)
                tell(len(compiled))

        def on_end(self, event: Any) -> None:
            pass

    with event.install_listener("numba:compile", Compiled()):
        yield


# ---------------------------------------------------------------------------------------------------- machine code on disk


class _Store:
    """The folder that machine code is kept in."""

    def __init__(self) -> None:
        self.is_used = True

    @cached_property
    def root(self) -> Path | None:
        """The first of several places that can be written, None where there is none."""
        from platformdirs import user_cache_path

        if _config().DISABLE_JIT:
            return None
        if folder := _config().CACHE_DIR or get_setting("machine_code_folder"):
            return Path(folder) / "rso_lidar"
        for folder in (Path(__file__).parent / "__pycache__", user_cache_path("rso_lidar")):
            with suppress(OSError):
                (folder / "kernels").mkdir(parents=True, exist_ok=True)
                tempfile.TemporaryFile(dir=folder / "kernels").close()
                return folder / "kernels"
        return private_folder()

    def empty(self, error: Exception) -> None:
        """Delete what is kept, after an error with one of its files."""
        if isinstance(error, OSError):  # such as a full disk: to delete would not help
            self.give_up(error)
            return
        if not isinstance(error, AttributeError | ImportError):  # these name what another version of the package had
            self._warn(error)
        if self.root is not None:
            shutil.rmtree(self.root, ignore_errors=True)
        self._forget()

    def give_up(self, error: Exception) -> None:
        """Keep nothing on disk in this process any more."""
        if self.is_used:
            self._warn(error)
        self.is_used = False
        self._forget()

    def _forget(self) -> None:
        for kernel in Kernel.all:
            kernel.forget()

    def _warn(self, error: Exception) -> None:
        warn(
            f"numba: machine code in {self.root} cannot be read or kept ({type(error).__name__}); it is compiled anew: "
            "if this comes again, empty that folder, or name another in NUMBA_CACHE_DIR"
        )


_store = _Store()


def _dispatcher(function: Callable[..., Any], folder: Path | None) -> Any:
    """Return numba's compiler of a function, with the folder in which it keeps machine code."""
    compiled = _compiler()(function)
    if folder is None:
        return compiled
    config = _config()
    before, config.CACHE_DIR = config.CACHE_DIR, str(folder)
    try:
        compiled.enable_caching()
        if Path(str(compiled.stats.cache_path)).is_relative_to(folder):
            return compiled
    except RuntimeError:  # numba finds no place at all
        pass
    finally:
        config.CACHE_DIR = before
    _store.give_up(PermissionError(folder))
    return _compiler()(function)


def _compiler(**options: Any) -> Any:
    """Return numba's decorator, without unused entry points: compiling each takes as long as a small loop."""
    import numba

    njit: Any = numba.njit
    return njit(nogil=True, error_model="numpy", no_cfunc_wrapper=True, **options)


def _config() -> Any:
    """Return numba's settings, whose names are made when it is imported."""
    import numba

    return numba.config


def _folder_of(kernel: Kernel) -> Path | None:
    """Return where machine code of a kernel is kept: one folder for each state of what it takes from elsewhere."""
    root: Path | None = _store.root if _store.is_used else None
    return (
        root
        and root / f"{kernel.function.__module__.rpartition('.')[2]}.{kernel.function.__name__}-{_state_of(kernel)}"
    )


@cache
def _state_of(kernel: Kernel) -> str:
    """Return a digest of a kernel, of the kernels that it calls and of the constants that it reads."""
    digest = hashlib.sha256()
    for piece in _state_pieces(kernel, {kernel}):
        digest.update(repr(piece).encode())
    return digest.hexdigest()[:16]


def _state_pieces(kernel: Kernel, known: set[Kernel]) -> Iterator[object]:
    """Yield what machine code depends on: byte code and constants, of kernels that are called too."""
    function: Any = kernel.function
    names: list[str] = []
    for code in _codes(function.__code__):
        yield code.co_code, code.co_names, [c for c in code.co_consts if not isinstance(c, CodeType)]
        names += code.co_names
    for name in names:
        value = function.__globals__.get(name)
        values = [value]
        if isinstance(value, ModuleType) and value.__name__.startswith("rso_lidar"):
            values = [getattr(value, attribute, None) for attribute in names]
        for item in values:
            if isinstance(item, Kernel) and item not in known:
                known.add(item)
                yield from _state_pieces(item, known)
            elif isinstance(item, np.ndarray):
                yield name, item.dtype, item.shape, item.tobytes()
            elif isinstance(item, (bool, int, float, complex, str, tuple, np.generic)):
                yield name, item


def _codes(code: CodeType) -> Iterator[CodeType]:
    """Yield the code of a function and of what is defined inside it."""
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def private_folder() -> Path | None:
    """Return a folder that only this user can write, in the system's place for temporary files.

    None, with a warning, where there cannot be one. Machine code is loaded from there, so a folder that another user owns or
    may write to is refused.
    """
    user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
    folder = Path(tempfile.gettempdir(), f"rso_lidar-cache-{user}")
    cure = "machine code is compiled in each process; name a folder for it in NUMBA_CACHE_DIR"
    try:
        with suppress(FileExistsError):
            folder.mkdir(mode=0o700)
        status = folder.lstat()  # a link may lead anywhere
        is_ours = not hasattr(os, "getuid") or (status.st_uid == os.getuid() and not status.st_mode & 0o022)
        if not stat.S_ISDIR(status.st_mode) or not is_ours:
            warn(f"{folder}: not a folder that only you can write to; {cure}")
            return None
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        warn(f"{folder}: cannot be written ({error.strerror}), nor can a cache in your home; {cure}")
        return None
    return folder


@contextmanager
def _locked(folder: Path | None) -> Iterator[None]:
    """Let one process at a time in: of several that start together one compiles, and the others read what it kept.

    Where there can be no lock, or its holder does not go on, this process does not wait.
    """
    if folder is None:
        yield
        return
    from filelock import FileLock, Timeout

    lock = FileLock(folder / "lock", timeout=_LONGEST_WAIT_S)
    with suppress(Timeout, OSError):
        folder.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    try:
        yield
    finally:
        lock.release()
