"""The official files of detectors and drives, from the network into a folder: checked, resumable,
unpacked with care.

The only module that touches the network.
"""

import logging
import lzma
import re
import shutil
import stat
import struct
import zipfile
import zlib
from http.client import HTTPException
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from urllib.error import HTTPError, URLError
from urllib.request import Request, urlopen

from genie_sim.base.errors import UserError, as_user_error, unknown
from genie_sim.base.paths import replace_durably, sha256_of, usable
from genie_sim.base.progress import Progress

log = logging.getLogger(__name__)

TIMEOUT_S = 30.0  # without a byte
CHUNK_BYTES = 1 << 18
TRIES = 3
MAX_UNPACKED_BYTES = 20 * 10**9  # KITTI's longest raw drives unpack to about 8 GB
MAX_ENTRIES = 200_000  # KITTI's longest raw drive has about 31,000 files
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
DRIVE = re.compile(r"(\d{4}_\d{2}_\d{2})_drive_(\d{4})")


def fetch_model(name: str, folder: Path, progress: Progress, base: str = YOLOX) -> Path:
    """The weights of a detector such as ``yolox-nano``; ``base`` is the place to take them from."""
    name = name.replace("_", "-")
    if name not in MODELS:
        raise UserError(unknown("model", name, MODELS))
    path = folder / f"{name.replace('-', '_')}.onnx"
    size_bytes, sha256 = MODELS[name]
    download(f"{base}/{path.name}", path, progress, sha256=sha256, size_bytes=size_bytes)
    return path


def fetch_drive(drive: str, folder: Path, progress: Progress, base: str = KITTI) -> Path:
    """A raw drive such as ``2011_09_26_drive_0005`` with its calibration and, where there are any,
    its tracklets.

    Returns KITTI's root folder, for ``--kitti``. The archives are removed once they are unpacked.
    """
    match = DRIVE.fullmatch(drive.removesuffix("_sync"))
    if match is None:
        raise UserError(f"drive {drive!r}: expected a name like 2011_09_26_drive_0005")
    date, name = match[1], match[0]
    for file, needed in (
        (f"{date}_calib.zip", True),
        (f"{name}/{name}_tracklets.zip", False),
        (f"{name}/{name}_sync.zip", True),
    ):
        archive = folder / Path(file).name
        try:
            download(f"{base}/{file}", archive, progress)
        except NotThere:
            if needed:
                raise
            log.info("%s: this drive has none", file)
            continue
        unpack(archive, folder)
        archive.unlink()
    return folder


class NotThere(UserError):
    """The server says that it has no such file."""


def download(
    url: str,
    path: Path,
    progress: Progress,
    *,
    sha256: str | None = None,
    size_bytes: int | None = None,
) -> None:
    """One file, written as ``.part`` and renamed once it is complete; a later call goes on where an
    earlier one stopped. A file that is there already, with the right hash, is left alone.

    Raises UserError, with what to do by hand, when there is no network, the server is too slow or
    the file is wrong.

    Parameters
    ----------
    url : where the file is
    path : where it is written
    progress : is called with the bytes received and all bytes
    sha256 : that the file must have, if it is known
    size_bytes : that the file must have, if it is known
    """
    by_hand = f"to do it by hand, put {url} at {path}"
    if path.is_file() and sha256 is not None and sha256_of(path) == sha256:
        return
    part = path.with_name(path.name + ".part")
    with usable(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        for attempt in range(1, TRIES + 1):
            try:
                _receive(url, part, progress, size_bytes)
                break
            except (URLError, HTTPException, TimeoutError, ConnectionError) as error:
                if isinstance(error, HTTPError) and error.code != 416 and error.code < 500:
                    kind = NotThere if error.code in (403, 404) else UserError
                    raise kind(f"{url}: {error.code} {error.reason}; {by_hand}") from error
                if isinstance(error, HTTPError) and error.code == 416:
                    part.unlink(missing_ok=True)  # more bytes here than the server has: start again
                log.info("%s: attempt %d: %s", url, attempt, error)
                if attempt == TRIES:
                    reason = getattr(error, "reason", None) or error
                    raise UserError(
                        f"{url}: not received ({reason}); try again to go on, or {by_hand}"
                    ) from error
        if sha256 is not None and (actual := sha256_of(part)) != sha256:
            part.unlink()
            raise UserError(
                f"{url}: sha256 {actual[:12]}... instead of {sha256[:12]}...: "
                f"corrupted or another file; {by_hand}"
            )
        replace_durably(part, path)


def unpack(archive: Path, folder: Path) -> list[Path]:
    """Files of a ZIP archive into a folder. Nothing is left there if an entry has no name, would
    leave the folder, is a link, is encrypted, appears twice, is where a folder must be or is
    broken, or if all of them are too many or unpack to too much; UserError says which.
    """
    root = folder.resolve()
    broken = (
        zipfile.BadZipFile,
        EOFError,
        NotImplementedError,
        RuntimeError,
        ValueError,
        lzma.LZMAError,
        struct.error,
        zlib.error,
    )
    with (
        usable(archive, "cannot be unpacked"),
        as_user_error(f"{archive}: not a readable ZIP archive", *broken),
        zipfile.ZipFile(archive) as packed,
    ):
        entries = [entry for entry in packed.infolist() if not entry.filename.endswith("/")]
        _check(archive, entries, root)
        root.mkdir(parents=True, exist_ok=True)
        # all of them, before any is put where it belongs
        with TemporaryDirectory(dir=root, prefix=f"{archive.name}.", suffix=".part") as whole:
            for entry in entries:
                part = Path(whole, entry.filename)
                part.parent.mkdir(parents=True, exist_ok=True)
                with packed.open(entry) as source, part.open("wb") as destination:
                    shutil.copyfileobj(source, destination)  # never more than the archive says
            for entry in entries:
                target = root / entry.filename
                target.parent.mkdir(parents=True, exist_ok=True)
                Path(whole, entry.filename).replace(target)
        return [root / entry.filename for entry in entries]


def _check(archive: Path, entries: list[zipfile.ZipInfo], root: Path) -> None:
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
    names: set[str] = set()
    folders = {
        str(folder).lower() for entry in entries for folder in PurePosixPath(entry.filename).parents
    }
    for entry in entries:
        name = PurePosixPath(entry.filename)
        outside = (
            name.is_absolute()
            or ".." in name.parts
            or "\\" in entry.filename
            or ":" in entry.filename
        )
        target = (root / name).resolve()
        for wrong, why in (
            (not name.name, "is no name of a file"),
            (outside, "leads out of the folder"),
            (
                not target.is_relative_to(root),
                "leads out of the folder, by a link that is there already",
            ),
            (
                stat.S_IFMT(entry.external_attr >> 16) not in (0, stat.S_IFREG),
                "is a link or a device, not a file",
            ),
            (entry.flag_bits & 1, "is encrypted"),
            (str(name).lower() in names, "is in the archive twice"),
            (str(name).lower() in folders, "is a file and a folder"),
            (
                target.is_dir() or any(part.is_file() for part in target.parents),
                "is a file where a folder is, or the other way round",
            ),
        ):
            if wrong:
                raise UserError(f"{archive}: {entry.filename!r} {why}")
        names.add(str(name).lower())


def _receive(url: str, part: Path, progress: Progress, size_bytes: int | None) -> None:
    size_here = part.stat().st_size if part.is_file() else 0
    headers = {"User-Agent": "genie-sim"}
    if size_here:
        headers["Range"] = f"bytes={size_here}-"
    request = Request(url, headers=headers)
    with urlopen(request, timeout=TIMEOUT_S) as answer:
        range_ = answer.headers.get("Content-Range") or ""
        is_rest = answer.status == 206 and range_.startswith(f"bytes {size_here}-")
        goes_on = size_here > 0 and is_rest
        done = size_here if goes_on else 0
        length = answer.headers.get("Content-Length")
        total = done + int(length) if length and re.fullmatch("[0-9]{1,18}", length) else size_bytes
        if size_bytes is not None and total is not None and total > size_bytes:
            raise UserError(f"{url}: {total:,} bytes instead of {size_bytes:,}: another file")
        with part.open("ab" if goes_on else "wb") as file:
            while chunk := answer.read(CHUNK_BYTES):
                done += len(chunk)
                if size_bytes is not None and done > size_bytes:
                    raise UserError(f"{url}: more than {size_bytes:,} bytes: another file")
                file.write(chunk)
                progress(done, total or done, "")
        if total is not None and done < total:
            raise ConnectionError(f"the connection ended after {done:,} of {total:,} bytes")
