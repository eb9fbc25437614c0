"""Look for files that break a reader: `python tests/faults/fuzz.py --seconds 600 --out FOLDER`.

Sound files are changed at random, knowing their formats, and read in a process that may die
(`reading.py`). What a reader should not have done is kept in FOLDER, one example of each fault.
"""

from __future__ import annotations

import argparse
import json
import random
import re
import shutil
import struct
import sys
import tempfile
import time
import zlib
from collections import Counter
from pathlib import Path
from typing import Any

from reading import Reader
from seeds import Files, chunk, glb, seeds

_NUMBERS = (
    0, 1, -1, 2, 3, 4, 7, 127, 128, 255, 256, 32767, 65535, 65536, 2**24, 2**31 - 1, 2**31, 2**32 - 1, 2**32, 2**63,
    10**30, -(2**31), 0.5, -0.5, 1e-40, 1e10, 1e30, 1e39, 1e300, float("nan"), float("inf"), -float("inf"),
)  # fmt: skip
_STRINGS = (
    "", "x", "a" * 5000, "../a.bin", "../../../etc/passwd", "/etc/passwd", "file:///etc/x", "data:,x",
    "data:;base64,!!!!", "\0", "%2e%2e/a", "C:\\a", "VEC3", "SCALAR", "MAT4", "MASK", "\ud800", "é", "a.glb", "a.gltf",
    ".", "color.png",
)  # fmt: skip
_TOKENS = (
    *map(str, _NUMBERS), *_STRINGS[:12], "1/2/3/4", "1//", "//", "/1", "0/0/0", "-1/-1/-1", "1e", "0x10", "1_0", "list",
    "uchar", "double", "ascii", "#", "\\",
)  # fmt: skip


class Fuzzer:
    """Random changes of files."""

    def __init__(self, seed: int) -> None:
        self.random = random.Random(seed)
        self.seeds = seeds()

    def case(self) -> Files:
        """Return a sound file with one to four changes."""
        files = dict(self.random.choice(self.seeds))
        for _ in range(self.random.choice((1, 1, 2, 4))):
            # Mostly the file itself; those beside it at times.
            names = list(files)
            name = names[0] if self.random.random() < 0.7 else self.random.choice(names)
            files[name] = self._changed(name, files[name])
        return files

    def _changed(self, name: str, data: bytes) -> bytes:
        gltf = [*[self._json] * 4, self._bytes, self._image]
        text = [*[self._text] * 3, self._bytes]
        changes = {
            "glb": gltf,
            "gltf": gltf,
            "obj": text,
            "mtl": text,
            "ply": [self._text, self._bytes],
            "png": [self._png, self._png, self._bytes],
            "exr": [self._header, self._header, self._bytes],
        }
        try:
            return self.random.choice(changes.get(name.rsplit(".", 1)[-1], [self._bytes]))(data)
        except (ValueError, IndexError, KeyError, TypeError, struct.error, RecursionError):
            return self._bytes(data)  # an earlier change left nothing to know the format by

    def _bytes(self, data: bytes, reach: int | None = None) -> bytes:
        chance = self.random
        out = bytearray(data)
        size = min(len(out), reach or len(out))
        if not size:
            return chance.randbytes(4)
        at = chance.randrange(size + 1)
        what = chance.randrange(7)
        if what == 0:
            return bytes(out[:at])
        if what == 1:
            out[at:at] = chance.randbytes(chance.choice((1, 2, 4, 64)))
        elif what == 2:
            del out[at : at + chance.choice((1, 2, 4, 64))]
        elif what == 3:
            out[at : at + 4] = struct.pack("<q", chance.choice(_integers()))[:4]
        elif what == 4:
            end = at + chance.randrange(1, 65)
            out[at:at] = out[at:end] * chance.choice((1, 2, 100))
        else:
            for place in (chance.randrange(size) for _ in range(chance.choice((1, 1, 3, 8)))):
                out[place] = chance.choice((0, 255, 128, 127, chance.randrange(256)))
        return bytes(out)

    def _header(self, data: bytes) -> bytes:
        """Change the head of an OpenEXR file, where names, types, sizes and windows are."""
        return self._bytes(data, 500)

    def _text(self, data: bytes) -> bytes:
        chance = self.random
        lines = data.split(b"\n")
        at = chance.randrange(len(lines))
        what = chance.randrange(8)
        if what == 0:
            del lines[at]
        elif what == 1:
            lines.insert(at, chance.choice(lines))
        elif what == 2:
            lines[at:at] = [chance.choice(lines)] * chance.choice((10, 1000))
        elif what == 3:
            other = chance.randrange(len(lines))
            lines[at], lines[other] = lines[other], lines[at]
        else:
            words = lines[at].split(b" ")
            place = chance.randrange(len(words))
            token = chance.choice(_TOKENS).encode("utf-8", "surrogatepass")
            if what == 4:
                words.insert(place, token)
            elif what == 5:
                words[place:] = words[place:] * chance.choice((2, 300))
            elif what == 6:
                del words[place]
            else:
                words[place] = token
            lines[at] = b" ".join(words)
        return b"\n".join(lines)

    def _json(self, data: bytes) -> bytes:
        is_glb = data[:4] == b"glTF"
        binary, text = b"", data
        if is_glb:
            (length,) = struct.unpack_from("<I", data, 12)
            text, binary = data[20 : 20 + length], data[28 + length :]
        made = json.loads(text)
        holders: list[Any] = []
        pile = [made]
        while pile:
            item = pile.pop()
            if isinstance(item, (dict, list)):
                holders += [item] if item else []
                pile += item.values() if isinstance(item, dict) else item
        holder = self.random.choice(holders)
        keys = list(holder) if isinstance(holder, dict) else list(range(len(holder)))
        key = self.random.choice(keys)
        what = self.random.randrange(10)
        if what == 0:
            del holder[key]
        elif what == 1 and isinstance(holder, list):
            holder += [holder[key]] * self.random.choice((1, 10, 3000))
        elif what == 2:
            other = self.random.choice(holders)
            holder[key] = self.random.choice(list(other.values()) if isinstance(other, dict) else other)
        elif what == 3:
            nested: Any = holder[key]
            for _ in range(self.random.choice((1, 3, 900))):
                nested = [nested] if self.random.random() < 0.8 else {"children": nested}
            holder[key] = nested
        elif what == 4:
            holder[key] = self.random.choice(_STRINGS)
        elif what == 5:
            holder[key] = self.random.choice((None, True, False, [], {}, [[]], [None], [{}]))
        else:
            holder[key] = self.random.choice(_NUMBERS)
        return glb(made, binary) if is_glb else json.dumps(made).encode()

    def _image(self, data: bytes) -> bytes:
        """Change the PNG image within a .glb file, without moving what follows it."""
        at = data.find(b"\x89PNG")
        if at < 0:
            return self._bytes(data)
        image = self._png(data[at:])[: len(data) - at]
        return data[:at] + image + data[at + len(image) :]

    def _png(self, data: bytes) -> bytes:
        """Change a chunk of a PNG file and put its checksum right."""
        chunks = []
        place = 8
        while place + 12 <= len(data):
            (size,) = struct.unpack_from(">I", data, place)
            chunks.append([data[place + 4 : place + 8], data[place + 8 : place + 8 + size]])
            place += 12 + size
        index = self.random.randrange(len(chunks))
        what = self.random.randrange(6)
        if what == 0:
            chunks.insert(index, list(self.random.choice(chunks)))
        elif what == 1:
            del chunks[index]
        elif what == 2 and chunks[0][0] == b"IHDR":
            columns, rows = (self.random.choice((0, 1, 9, 4096, 65536, 2**31 - 1)) for _ in "xy")
            chunks[0][1] = struct.pack(">2I", columns, rows) + chunks[0][1][8:]
        elif what == 3:
            kind = self.random.choice((b"iCCP", b"zTXt", b"iTXt", b"PLTE", b"tRNS", b"acTL"))
            text = b"a\0\0" + zlib.compress(bytes(self.random.choice((10, 1 << 24))))
            chunks.insert(1, [kind, text])
        elif what == 4 and chunks[index][0] == b"IDAT":
            chunks[index][1] = zlib.compress(bytes(self.random.choice((10, 1 << 24))))
        else:
            chunks[index][1] = self._bytes(chunks[index][1])
        return data[:8] + b"".join(chunk(kind, body) for kind, body in chunks)


def _integers() -> list[int]:
    return [number for number in _NUMBERS if isinstance(number, int) and abs(number) < 2**63]


def main() -> int:
    """Run for as long as asked; return the number of kinds of faults."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    fuzzer, reader = Fuzzer(asked.seed), Reader()
    counts: Counter[str] = Counter()
    slowest = largest = 0.0
    end = time.monotonic() + asked.seconds
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch) / "case"
        while time.monotonic() < end:
            files = fuzzer.case()
            shutil.rmtree(folder, ignore_errors=True)
            folder.mkdir()
            for name, data in files.items():
                (folder / name).write_bytes(data)
            main_file = next(iter(files))
            found = reader.verdict(folder / main_file)
            slowest = max(slowest, found["seconds"])
            largest = max(largest, found.get("mebibytes", 0.0))
            suffix = main_file.rsplit(".", 1)[-1]
            counts[f"{suffix} {found['outcome']}"] += 1
            if found["outcome"] not in ("loaded", "refused"):
                place = re.sub(r"[^\w.]", "_", Path(found["place"]).name)
                kept = asked.out / f"{suffix}-{found['outcome']}-{place or 'unknown'}"
                if not kept.exists():
                    shutil.copytree(folder, kept)
                    (kept / "verdict.json").write_text(json.dumps(found, indent=1))
                    print(f"{kept.name}: {found['detail'][:200]}", flush=True)
    reader.close()
    print(json.dumps(dict(sorted(counts.items())), indent=1))
    print(f"{sum(counts.values())} files; slowest {slowest:.2f} s, largest {largest:.0f} MiB")
    return sum(1 for key in counts if key.split()[1] not in ("loaded", "refused"))


if __name__ == "__main__":
    sys.exit(main())
