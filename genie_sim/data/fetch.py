"""The official files of detectors and drives, from the network into a folder: received by pooch,
checked, unpacked with care.

The only module that touches the network. pooch comes with the extra ``fetch``.
"""

import filecmp
import logging
import stat
import struct
import zipfile
import zlib
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.base.paths import sha256_of, usable
from genie_sim.base.progress import Progress
from genie_sim.data.kitti.drive_name import DriveName

log = logging.getLogger(__name__)

TIMEOUT_S = 30.0  # without a byte
CHUNK_BYTES = 1 << 18
MAX_REASON = 300  # characters of what the network says
MAX_UNPACKED_BYTES = 20 * 10**9  # KITTI's longest raw drives unpack to about 8 GB
MAX_ENTRIES = 200_000  # KITTI's longest raw drive has about 31,000 files
# Python unpacks others whole, however much an entry says that it holds.
METHODS = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
MAX_RATIO = 100  # of an archive; scans and pictures shrink by a fifth at most, text to a tenth


# By what ``--detector`` calls them: bytes and SHA-256, as several public projects pin them.
YOLOX = "https://github.com/Megvii-BaseDetection/YOLOX/releases/download/0.1.1rc0"
MODELS = {
    "yolox-nano": (3_659_407, "c789161ed43c8269fcd4e67c67eeeb4e80c622da2eb296a20bc6007bd18a0b7d"),
    "yolox-tiny": (20_219_662, "427cc366d34e27ff7a03e2899b5e3671425c262ea2291f88bb942bc1cc70b0f7"),
    "yolox-s": (35_858_002, "c5c2d13e59ae883e6af3b45daea64af4833a4951c92d116ec270d9ddbe998063"),
}

# KITTI publishes no hashes of its archives; the name of a drive is checked, and what is in the
# archive.
KITTI = "https://s3.eu-central-1.amazonaws.com/avg-kitti/raw_data"


def fetch_model(name: str, folder: Path, progress: Progress, base: str = YOLOX) -> Path:
    """The weights of a detector such as ``yolox-nano``; ``base`` is the place to take them from."""
    name = name.replace("_", "-")
    if name not in MODELS:
        raise UserError(unknown("model", name, MODELS))
    size_bytes, sha256 = MODELS[name]
    url = f"{base}/{name.replace('-', '_')}.onnx"
    return receive(url, folder, progress, sha256=sha256, most_bytes=size_bytes)


def fetch_drive(drive: str, folder: Path, progress: Progress, base: str = KITTI) -> Path:
    """A raw drive such as ``2011_09_26_drive_0005`` with its calibration and, where there are any,
    its tracklets.

    Returns KITTI's root folder, for ``--kitti``. The archives are not kept.
    """
    name = DriveName.parse(drive)
    if not name.is_raw:
        raise UserError(f"drive {drive!r}: only raw drives are fetched, such as 2011_09_26/0005")
    with usable(folder):
        folder.mkdir(parents=True, exist_ok=True)
    for file, is_needed in (
        (f"{name.part}_calib.zip", True),
        (f"{name.raw}/{name.raw}_tracklets.zip", False),
        (f"{name.raw}/{name.raw}_sync.zip", True),
    ):
        with usable(folder), TemporaryDirectory(dir=folder, suffix=".part") as received:
            try:
                unpack(receive(f"{base}/{file}", Path(received), progress), folder)
            except NotThere:
                if is_needed:
                    raise
                log.info("%s: this drive has none", file)
    return folder


class NotThere(UserError):
    """The server says that it has no such file."""


def receive(
    url: str,
    folder: Path,
    progress: Progress,
    *,
    sha256: str | None = None,
    most_bytes: int = MAX_UNPACKED_BYTES,
) -> Path:
    """One file in a folder, whole or not there. One that is there already, with the right hash, is
    left alone.

    Raises UserError, with what to do by hand, when there is no network, the server is too slow or
    the file is wrong.

    Parameters
    ----------
    url : where the file is
    folder : where it is written, under its name
    progress : is called with the bytes received and all bytes
    sha256 : that the file must have, if it is known
    most_bytes : that are received
    """
    try:
        import pooch
        from requests import HTTPError
    except ImportError:
        text = "pooch is not installed: pip install 'genie-sim[fetch]'"
        raise UserError(f"import fetch: {text}") from None
    pooch.get_logger().setLevel("WARNING")
    path = folder / url.rpartition("/")[2]
    if path.exists() and not path.is_file():
        raise UserError(f"{path}: cannot be written: no file of that name")
    if path.exists() and sha256 not in (None, sha256_of(path)):
        raise UserError(f"{path}: is there already, and is not that of {url}; say where else")
    by_hand = f"{url}: not received; to do it by hand, put it, a ZIP unpacked, into --out"
    downloader = pooch.HTTPDownloader(
        progressbar=_Counted(url, most_bytes, progress),
        chunk_size=CHUNK_BYTES,
        timeout=TIMEOUT_S,
        headers={"User-Agent": "genie-sim", "Accept-Encoding": "identity"},
    )
    with as_user_error(by_hand, OSError, ValueError, most=MAX_REASON):
        try:
            pooch.retrieve(url, sha256, path.name, folder, downloader=downloader)
        except HTTPError as error:
            if error.response is not None and error.response.status_code in (403, 404):
                raise NotThere(f"{by_hand}: {error.response.status_code}") from error
            raise
    return path


class _Counted:
    """What pooch calls as bytes come. Raises UserError where they are more than ``most_bytes``."""

    total = 0

    def __init__(self, url: str, most_bytes: int, progress: Progress) -> None:
        self._url, self._most_bytes, self._progress = url, most_bytes, progress
        self._done = 0

    def update(self, size_bytes: int) -> None:
        # a chunk counts as a whole one, and may be the last
        most_bytes = self._most_bytes
        if max(self.total, self._done) > most_bytes:
            raise UserError(f"{self._url}: more than {most_bytes:,} bytes: another file")
        self._done += size_bytes
        done = min(self._done, self.total or self._done)
        self._progress(done, self.total or done, "")

    def reset(self) -> None:
        self._done = 0

    def close(self) -> None:
        pass


def unpack(archive: Path, folder: Path) -> None:
    """Files of a ZIP archive into a folder. Nothing is left there if an entry has no name, would
    leave the folder, is a link, is encrypted, appears twice, is where a folder or another file is
    or is broken, or if all of them are too many or unpack to too much; UserError says which.
    """
    root = folder.resolve()
    broken = (
        zipfile.BadZipFile,
        EOFError,
        NotImplementedError,
        RuntimeError,
        ValueError,
        struct.error,
        zlib.error,
    )
    with (
        usable(archive, "cannot be unpacked"),
        as_user_error(f"{archive}: not a readable ZIP archive", *broken),
        zipfile.ZipFile(archive) as packed,
    ):
        entries = [entry for entry in packed.infolist() if not entry.filename.endswith("/")]
        _check_sizes(archive, entries)
        targets = _targets(archive, entries, root)
        root.mkdir(parents=True, exist_ok=True)
        # all of them, before any is put where it belongs; never more than the archive says
        with TemporaryDirectory(dir=root, prefix=f"{archive.name}.", suffix=".part") as whole:
            parts = [packed.extract(entry, whole) for entry in entries]
            for part, target in zip(parts, targets, strict=True):
                if target.exists() and not filecmp.cmp(part, target, shallow=False):
                    text = f"is there already, and is not that of {archive.name}; say where else"
                    raise UserError(f"{target}: {text}")
            for part, target in zip(parts, targets, strict=True):
                target.parent.mkdir(parents=True, exist_ok=True)
                Path(part).replace(target)


def _check_sizes(archive: Path, entries: Sequence[zipfile.ZipInfo]) -> None:
    total, packed = sum(entry.file_size for entry in entries), archive.stat().st_size
    if len(entries) > MAX_ENTRIES:
        raise UserError(f"{archive}: has {len(entries):,} files, more than {MAX_ENTRIES:,}")
    if total > MAX_UNPACKED_BYTES:
        raise UserError(f"{archive}: unpacks to {total:,} bytes, more than {MAX_UNPACKED_BYTES:,}")
    if total > max(MAX_RATIO * packed, CHUNK_BYTES):
        raise UserError(
            f"{archive}: unpacks to {total:,} bytes from {packed:,}, "
            f"more than {MAX_RATIO} times as many"
        )


def _targets(archive: Path, entries: Sequence[zipfile.ZipInfo], root: Path) -> list[Path]:
    """Where each entry belongs. Raises UserError for one that may not be there."""
    targets: dict[Path, None] = {}
    for entry in entries:
        target = (root / entry.filename).resolve()  # whatever links are there
        for wrong, why in (
            (target == root, "is no name of a file"),
            (not target.is_relative_to(root), "leads out of the folder"),
            (target in targets, "is there twice"),
            (
                stat.S_IFMT(entry.external_attr >> 16) not in (0, stat.S_IFREG),
                "is a link or a device, not a file",
            ),
            (entry.compress_type not in METHODS, "is neither stored nor deflated"),
            (
                target.is_dir() or any(part.is_file() for part in target.parents),
                "is a file where a folder is, or the other way round",
            ),
        ):
            if wrong:
                raise UserError(f"{archive}: {entry.filename!r} {why}")
        targets[target] = None
    return [*targets]
