"""Damaged files of every format, read in a process that is stopped when one of them takes too long or too much.

    python -m tests.bench.mutated_files FORMAT COUNT FOLDER

ends with 0 if each file was read, or refused by an error that a command turns into one sentence. Records are refused by
the name of their file, because many are read at once.
"""

import io
import json
import resource
import signal
import sys
import time
import zipfile
from collections.abc import Callable
from pathlib import Path
from types import FrameType

import numpy as np


PROCESSOR_TIME = 5.0  # s of one file; a thousandth of it is usual
MEMORY = 1 << 30  # bytes above what the process held before the first file
T = np.round(np.arange(120) / 100, 9)
CHANNELS = {"t_s": T, "x_mm": np.round(20 * np.sin(9 * T), 6), "F_N": np.round(800 * np.cos(9 * T), 6)}
ROWS = [list(CHANNELS), *(list(map(float, row)) for row in zip(*CHANNELS.values(), strict=True))]
MANIFEST = """
sign = "rebound-positive"
sampling_rate = 100.0
command = { "*" = 0.5 }
files = ["*.csv"]
delimiter = ","
test = "bench 7"
[columns]
time = "t_s"
stroke = "x_mm"
force = "F_N"
[units]
stroke = "mm"
[settings."*"]
current = 0.5
"""


class TooSlow(BaseException):
    """A file takes more processor time than it may. No `Exception`, so that no reader turns it into another."""


def workbook(path: Path) -> None:
    import openpyxl

    book = openpyxl.Workbook()
    for row in ROWS:
        book.worksheets[0].append(row)
    book.save(path)


def mat5(path: Path) -> None:
    import scipy.io

    scipy.io.savemat(path, {"rec": {**CHANNELS, "units": {"x_mm": "mm"}, "note": "A. B."}})


def mat73(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        group = file.create_group("rec")
        for name, values in CHANNELS.items():
            group[name] = values[None]
    with path.open("r+b") as raw:
        raw.write(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\0\2IM")


def tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        writer.write_segment([ChannelObject("run", name, values) for name, values in CHANNELS.items()])


def mf4(path: Path) -> None:
    from asammdf import MDF, Signal

    with MDF() as file:
        for name, unit in (("x_mm", "mm"), ("F_N", "N")):
            file.append([Signal(CHANNELS[name], T, unit=unit, name=name)])
        file.save(path)


def parquet(path: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table(CHANNELS), path)


def text(path: Path) -> None:
    path.write_text("\n".join(",".join(map(str, row)) for row in ROWS))


def manifest(path: Path) -> None:
    path.write_text(MANIFEST)


def law(path: Path) -> None:
    from jaxdamp.dampers import Bilinear, CoulombFriction, SeriesSpring
    from jaxdamp.export import to_json

    to_json(SeriesSpring(Bilinear(4000.0, 1000.0), 3e5) + CoulombFriction(150.0, 0.005), path)


def road(path: Path) -> None:
    path.write_text("\n".join(["distance [m],height [mm]", *(f"{x:.2f},{5 * np.sin(x):.4f}" for x in 10 * T)]))


def read_record(path: Path) -> None:
    from jaxdamp import bench

    bench.read(path)


def read_table(path: Path) -> None:
    from jaxdamp import bench

    bench.read_table(path)


def read_with_manifest(path: Path) -> None:
    from jaxdamp import bench

    text(path.with_name("record.csv"))
    bench.read(path.with_name("record.csv"), manifest=path)


def read_law(path: Path) -> None:
    from jaxdamp.export import from_json

    from_json(path)


def read_road(path: Path) -> None:
    from jaxdamp import roads

    roads.read_profile(path, speed=10.0, height_unit="mm")


FORMATS: dict[str, tuple[str, Callable[[Path], None], Callable[[Path], None]]] = {
    "xlsx": ("a.xlsx", workbook, read_record),
    "mat": ("a.mat", mat5, read_record),
    "mat73": ("a.mat", mat73, read_record),
    "tdms": ("a.tdms", tdms, read_record),
    "mf4": ("a.mf4", mf4, read_record),
    "parquet": ("a.parquet", parquet, read_record),
    "text": ("a.csv", text, read_record),
    "table": ("a.csv", text, read_table),
    "manifest": ("a.toml", manifest, read_with_manifest),
    "law": ("a.json", law, read_law),
    "road": ("a.csv", road, read_road),
}
WORDS = (
    b"nan",
    b"1e999",
    b"-1",
    b"999999999999",
    b"[[[[",
    b"{",
    b"}",
    b'"',
    b"\n",
    b"\0",
    b"=",
    b".",
    b"",
    b"\xff\xff",
)


def damaged(content: bytes, random: np.random.Generator) -> bytes:
    """The content after one to four kinds of damage: bits, lengths, words, parts lost, repeated or exchanged."""
    for _ in range(random.integers(1, 5)):
        size = max(len(content), 1)
        at, length = int(random.integers(size)), int(2 ** random.integers(0, 8))
        before, part, behind = content[:at], content[at : at + length], content[at + length :]
        match random.integers(7):
            case 0:
                content = before + bytes(b ^ (1 << int(random.integers(8))) for b in part[:4]) + part[4:] + behind
            case 1:
                content = before + random.bytes(length) + behind
            case 2:
                content = before + b"\xff" * min(length, 8) + part[min(length, 8) :] + behind
            case 3:
                content = before + WORDS[random.integers(len(WORDS))] + part + behind
            case 4:
                content = before + behind
            case 5:
                content = before + part * int(random.integers(2, 40)) + behind
            case _:
                content = before if random.integers(4) == 0 else before + b"\0" * len(part) + behind
    return content


def damaged_workbook(content: bytes, random: np.random.Generator) -> bytes:
    """A workbook with damage inside one of its parts, which a sum over the packed bytes would hide otherwise."""
    if random.integers(4) == 0:
        return damaged(content, random)
    packed = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as new:
        names = old.namelist()
        hit = names[random.integers(len(names))] if random.integers(2) else "xl/worksheets/sheet1.xml"
        for name in names:
            part = old.read(name)
            new.writestr(name, damaged(part, random) if name == hit else part)
    return packed.getvalue()


def stop(number: int, frame: FrameType | None) -> None:
    raise TooSlow


def refused(read: Callable[[Path], None], path: Path) -> str:
    """What is wrong with the answer to a file; empty where it was read, or refused with its name."""
    signal.setitimer(signal.ITIMER_PROF, PROCESSOR_TIME)
    try:
        read(path)
    except (ValueError, OSError, ImportError) as error:
        named = read is not read_record or str(path.parent) in str(error)  # of one document the caller knows the name
        return "" if named else f"does not name the file: {error}"
    except TooSlow:
        return f"takes more than {PROCESSOR_TIME} s of processor time"
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return ""


def main(kind: str, count: int, folder: Path) -> int:
    name, write, read = FORMATS[kind]
    sound, path = folder / f"sound{Path(name).suffix}", folder / name
    write(sound)
    problem = refused(read, sound) if kind == "table" else (read(sound), "")[1]
    content, random = sound.read_bytes(), np.random.default_rng(7)
    held = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    signal.signal(signal.SIGPROF, stop)
    problems = [problem] if problem else []
    for index in range(count):
        path.write_bytes((damaged_workbook if kind == "xlsx" else damaged)(content, random))
        (folder / "last").write_text(str(index))
        if problem := refused(read, path):
            problems.append(f"mutant {index}: {problem}")
            (folder / f"mutant_{index}{path.suffix}").write_bytes(path.read_bytes())
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - held) * 1024
    if grown > MEMORY:
        problems.append(f"the files took {grown / 2**20:.0f} MiB")
    print(json.dumps({"problems": problems, "grown_MiB": grown >> 20, "processor_time": time.process_time()}))
    return len(problems) > 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], int(sys.argv[2]), Path(sys.argv[3])))
