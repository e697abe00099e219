"""Measure what the encoder, the decoder and their conversions of colours do to the frames of films.

`python tests/bench/encoding.py DATA` writes docs/benchmarks/encoding.md. Frames are drawn once, at the default
tolerance. Sizes and errors depend on ffmpeg alone; times depend on the machine, too.
"""

from __future__ import annotations

import re
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
from measuring import PAGES, medians_in_turns, parser_of
from scipy import ndimage

from hsplat_cli.terminal import describe_machine
from renderer import render, suggest_scene
from renderer.film import Picture, decode_known_film, find_ffmpeg
from renderer.film.encode import gif_options, mp4_options, open_encoder
from renderer.volume import UInt8

PAGE = PAGES / "encoding.md"
VOLUMES = {"engine": "engine.nhdr", "bonsai": "bonsai.nhdr", "head": "medical/headsq_quarter.nrrd"}
SIZE, NUM_FRAMES, NUM_DECODED, REPEATS = (512, 512), 24, 120, 5
CRF, LOW_CRF = 16, 34  # of qualities 8 and 2
CRFS = (22, 19, 16, 13, 10, 7)
LUMA = np.array([0.2126, 0.7152, 0.0722], np.float32)  # BT.709

HEAD = """# What the encoder keeps

Footprint: `integrated`, the default. Measure again when ffmpeg, the options in `renderer/film/encode.py` or the
conversion in `renderer/film/decode.py` change.

`python tests/bench/encoding.py DATA` writes this page. The first 24 frames of suggested turntables of 120, 512 x 512,
are drawn once, encoded at quality 8 (CRF 16), decoded, and compared with what was drawn. PSNR is of all channels, in
dB. Errors are means with their sign, in steps of 255.

{date}, {ffmpeg}. Commit {commit}; {processor}, {cores} cores.

"""
STEPS_HEAD = """## Where the error comes from

`drawn` is the error of channels that were drawn at 200 or more, `shown` that of channels that are 200 or more in the
film, and `areas` that of the tenth of the lit pixels whose surroundings of 9 x 9 pixels are brightest.

"""
FINDINGS = """
- **Films do not get darker; a fast decoder makes them so.** Unless it is told otherwise, ffmpeg converts YUV 4:2:0 to
  RGB by a fast path, also in imageio and other programs. It cuts off in place of rounding, and takes one step from all
  pixels. With `accurate_rnd` and `full_chroma_int` nothing is lost, and this is how `decode.py` reads films.
- The conversion to YUV rounds correctly. Other filters, and dithering, change little or nothing.
- Bright areas keep their brightness to 0.3 steps. Small peaks do not, above all the coloured highlights of the bonsai
  (0.01 % of its channels): the quantiser smooths them and takes some of their saturation. `drawn` overstates that,
  because pixels chosen for being bright tend to get darker, and `shown` understates it. It becomes less with the CRF.
- Unless told where it is, ffmpeg reads chroma from the centre, though the encoder puts it to the left, H.264's default.
  `decode.py` says so.
- Half the resolution of the chroma limits a film to 51 to 55 dB. At quality 8 the quantiser limits it, and all chroma
  (yuv444p) would gain 0.3 dB at most.

## Settings of x264

All rows are at CRF 16 but those that name another. `size` and `PSNR` are differences from x264's defaults, means of the
three films; `gain` is the PSNR over that of x264's defaults with the CRF that gives the same size. `lit` is the
percentage of pixels in black surroundings (9 x 9) that are not black in the film, and `low` the same at quality 2.
`drawn`, `lit` and `low` are means of the films. `time` is a factor; beside other work it varies by a third.

"""
CONCLUSION = """
- x264's defaults spend bits on the look of grain (psy) and on flat parts (AQ), and save them on chroma. Renderings have
  no grain. The settings in use, `psy=0:aq-strength=0.7:chroma-qp-offset=-4`, gain at equal size in all films, and the
  files have about the same size as before at the same quality. They were chosen among some 60 combinations on these
  scans, so the gain may be flattered.
- Without AQ (`aq-mode=0`, `tune psnr`) the gain is larger, but at a low quality more than a third of the black
  background is not black any more. So most of AQ stays.
- `preset slow` gains another 0.2 dB and takes 1.4 times as long, while frames are drawn. Other deblocking, trellis and
  decimation of coefficients gain 0.1 dB at most.
- Six steps of CRF are 2.8 dB and 2.2 times the size. For more than quality 10 gives, write PNG frames.

## Decoding

{num} frames of 512 x 512 take {mp4:.2f} s from an MP4 and {gif:.2f} s from a GIF
(medians of {repeats}, beside other work).
"""

Pictures = UInt8
Options = Sequence[str]
Decoder = Callable[[Path], Pictures]


class Coding(NamedTuple):
    """The bytes of a film and the differences of its frames from those that were drawn, as on the page."""

    size: int
    psnr: float
    drawn: float
    shown: float
    areas: float
    lit: float


def main() -> None:
    data = parser_of(__doc__).parse_args().data
    with TemporaryDirectory() as name:
        folder = Path(name)
        films = {name: draw(data / volume, folder / name) for name, volume in VOLUMES.items()}
        steps, settings = [*step_rows(films, folder)], [*setting_rows(films, folder)]
        mp4, gif = decoding_times(films["engine"], folder)
    version = subprocess.run([find_ffmpeg(PAGE), "-version"], check=True, capture_output=True, text=True).stdout
    ffmpeg = " ".join(version.split()[:3])
    head = HEAD.format(date=time.strftime("%Y-%m-%d"), ffmpeg=ffmpeg, **describe_machine("kernels"))
    tail = CONCLUSION.format(num=NUM_DECODED, mp4=mp4, gif=gif, repeats=REPEATS)
    lines = [head + STEPS_HEAD.rstrip(), "", *steps, FINDINGS.rstrip(), "", *settings, tail.rstrip()]
    PAGE.write_text("\n".join(lines) + "\n", encoding="utf-8")


def options_with(crf: float = CRF, *, ours: bool = False, **changes: str) -> Options:
    """Return ffmpeg's options with x264's defaults, or with ours, and with other values of some options."""
    words = iter(mp4_options(8))
    options = dict(zip(words, words, strict=True)) | {"-crf": f"{crf:g}"}
    if not ours:
        del options["-x264-params"]
    options |= {f"-{option.replace('_', '-')}": value for option, value in changes.items()}
    return [word for pair in options.items() for word in pair]


def defaults(crf: float) -> Options:
    """Return the options with x264's defaults."""
    return options_with(crf)


def x264(parameters: str, crf: float) -> Options:
    """Return the options with settings of x264 in place of ours."""
    return options_with(crf, x264_params=parameters)


def converted(pattern: str, replacement: str, *, lossless: bool = True) -> Options:
    """Return the options with another conversion of colours. lossless: without a quantiser."""
    words = options_with(0 if lossless else CRF)
    words = [re.sub(pattern, replacement, word) if word.startswith("scale=") else word for word in words]
    return [*words, "-profile:v", "high444"]  # High has neither lossless coding nor yuv444p


def draw(volume: Path, folder: Path) -> Pictures:
    """Draw the first frames of a turntable: uint8 [frame, h, w, 3]."""
    names = f"{folder}/{{frame:04}}.png"
    render(suggest_scene(volume, size=SIZE), output=names, frames=range(NUM_FRAMES), on_progress=None)
    return np.stack([Picture(file=file).pixels for file in sorted(folder.glob("*.png"))])


def encode(pictures: Pictures, options: Options, file: Path) -> float:
    """Write a film; return the seconds that it took."""
    begin = time.perf_counter()
    with open_encoder(SIZE, Fraction(30), options, file, file) as write:
        for picture in pictures:
            write(picture)
    return time.perf_counter() - begin


def decode(file: Path) -> Pictures:
    with decode_known_film(file, SIZE, NUM_FRAMES) as frames:
        return np.stack(list(frames))


def decode_otherwise(file: Path, conversion: str = "null") -> Pictures:
    """Decode with another conversion to RGB, by default the one that ffmpeg has unless it is told otherwise."""
    source, sink = ["-v", "error", "-i", f"file:{file}"], ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    command = [find_ffmpeg(file), *source, "-vf", conversion, *sink]
    raw = subprocess.run(command, check=True, capture_output=True).stdout
    return np.frombuffer(raw, np.uint8).reshape(-1, SIZE[1], SIZE[0], 3)


def code(pictures: Pictures, options: Options, folder: Path, decoder: Decoder = decode) -> Coding:
    """Encode, decode and compare."""
    file = folder / "film.mp4"
    encode(pictures, options, file)
    film = decoder(file)
    error = film.astype(np.float32) - pictures
    around = ndimage.uniform_filter(pictures @ LUMA, (0, 9, 9))
    is_black = ndimage.maximum_filter(pictures.max(axis=3), (0, 9, 9)) == 0
    psnr = float(10 * np.log10(255**2 / np.mean(error**2)))
    parts = pictures >= 200, film >= 200, around >= np.percentile(around[around > 8], 90)
    means = [float(error[part].mean()) for part in parts]
    return Coding(file.stat().st_size, psnr, *means, lit=float(100 * film.any(axis=3)[is_black].mean()))


def row(cells: Sequence[str]) -> str:
    return f"| {' | '.join(cells)} |"


def step_rows(films: dict[str, Pictures], folder: Path) -> Iterator[str]:
    """Yield the table of errors with and without a quantiser, and with other conversions."""
    words = ("PSNR", "drawn", "shown", "areas")
    yield row(["step", *(f"{name}: {word}" for name in films for word in words)])
    yield row(["---"] * (1 + len(words) * len(films)))
    for name, options, decoder in STEPS:
        codings = [code(pictures, options, folder, decoder) for pictures in films.values()]
        yield row([name, *(f"{c.psnr:.1f} | {c.drawn:+.2f} | {c.shown:+.2f} | {c.areas:+.2f}" for c in codings)])


def setting_rows(films: dict[str, Pictures], folder: Path) -> Iterator[str]:
    """Yield the table of settings of x264."""
    curves = [{crf: code(pictures, defaults(crf), folder) for crf in CRFS} for pictures in films.values()]
    yield row(["setting", "size", "PSNR", *(f"{name}: gain" for name in films), "drawn", "lit", "low", "time"])
    yield row(["---"] * (len(films) + 7))
    for name, options in SETTINGS.items():
        codings = [code(pictures, options(CRF), folder) for pictures in films.values()]
        low = [code(pictures, options(LOW_CRF), folder).lit for pictures in films.values()]
        works = [partial(encode, films["engine"], each(CRF), folder / "time.mp4") for each in (options, defaults)]
        seconds = medians_in_turns(works, REPEATS)
        pairs = [*zip(codings, curves, strict=True)]
        sizes = [coding.size / curve[CRF].size for coding, curve in pairs]
        psnrs = [coding.psnr - curve[CRF].psnr for coding, curve in pairs]
        means = np.mean(
            [sizes, psnrs, [coding.drawn for coding in codings], [coding.lit for coding in codings], low], 1
        )
        gains = [f"{gain(coding, [*curve.values()]):+.2f}" for coding, curve in pairs]
        cells = [f"{100 * means[0] - 100:+.0f} %", f"{means[1]:+.2f}", *gains, f"{means[2]:+.2f}", f"{means[3]:.2f}"]
        yield row([name, *cells, f"{means[4]:.1f}", f"{seconds[0] / seconds[1]:.1f}"])


def gain(coding: Coding, curve: Sequence[Coding]) -> float:
    """Return the PSNR above that of a curve of films, smallest first, at the same size."""
    sizes = np.log([each.size for each in curve])
    return float(coding.psnr - np.interp(np.log(coding.size), sizes, [each.psnr for each in curve]))


def decoding_times(pictures: Pictures, folder: Path) -> list[float]:
    """Return the seconds that an MP4 and a GIF take to be decoded."""

    def taken(file: Path) -> float:
        begin = time.perf_counter()
        with decode_known_film(file, SIZE, NUM_DECODED) as frames:
            assert sum(1 for _ in frames) == NUM_DECODED
        return time.perf_counter() - begin

    files = {folder / "time.mp4": options_with(ours=True), folder / "time.gif": gif_options()}
    there_and_back = np.concatenate([pictures, pictures[::-1]] * NUM_DECODED)
    for file, options in files.items():
        encode(there_and_back[:NUM_DECODED], options, file)
    return medians_in_turns([partial(taken, file) for file in files], REPEATS)


_UNPLACED = "scale=flags=bicubic+accurate_rnd+full_chroma_int+full_chroma_inp+bitexact,format=rgb24"
# Name, options, decoder.
STEPS: Sequence[tuple[str, Options, Decoder]] = (
    ("conversion alone, without loss", converted("", ""), decode),
    ("... to yuv444p", converted("yuv420p", "yuv444p"), decode),
    ("... chroma put in the centre", converted("out_h_chr_pos=0", "out_h_chr_pos=128"), decode),
    ("... lanczos", converted("bicubic", "lanczos"), decode),
    ("... bilinear", converted("bicubic", "bilinear"), decode),
    ("... without `accurate_rnd` and the like", converted(r"bicubic[+\w]*", "bicubic"), decode),
    ("... without dithering", converted(":flags", ":sws_dither=none:flags"), decode),
    ("... decoded without the place of chroma", converted("", ""), partial(decode_otherwise, conversion=_UNPLACED)),
    ("... decoded by ffmpeg's fast path", converted("", ""), decode_otherwise),
    ("x264's defaults", options_with(), decode),
    ("... to yuv444p", converted("yuv420p", "yuv444p", lossless=False), decode),
    ("settings in use", options_with(ours=True), decode),
    ("... decoded by ffmpeg's fast path", options_with(ours=True), decode_otherwise),
)
SETTINGS: dict[str, Callable[[float], Options]] = {
    "x264's defaults": defaults,
    "**in use**": partial(options_with, ours=True),
    "in use, `preset slow`": partial(options_with, ours=True, preset="slow"),
    "in use, chroma-qp-offset=-6": partial(x264, "psy=0:aq-strength=0.7:chroma-qp-offset=-6"),
    "in use, aq-strength=0.5": partial(x264, "psy=0:aq-strength=0.5:chroma-qp-offset=-4"),
    "in use, aq-mode=0": partial(x264, "psy=0:aq-mode=0:chroma-qp-offset=-4"),
    "psy=0": partial(x264, "psy=0"),
    "chroma-qp-offset=-4": partial(x264, "chroma-qp-offset=-4"),
    "aq-mode=0": partial(x264, "aq-mode=0"),
    "`tune psnr`": partial(options_with, tune="psnr"),
    "`tune animation`": partial(options_with, tune="animation"),
    "`tune film`": partial(options_with, tune="film"),
    "`tune grain`": partial(options_with, tune="grain"),
    "`preset slow`": partial(options_with, preset="slow"),
    "no-dct-decimate": partial(x264, "no-dct-decimate=1"),
    "deblock=-1,-1": partial(x264, "deblock=-1,-1"),
    "no-deblock": partial(x264, "no-deblock=1"),
    "trellis=0": partial(x264, "trellis=0"),
    "trellis=0, deadzones of 6": partial(x264, "trellis=0:deadzone-inter=6:deadzone-intra=6"),
    "defaults, CRF 13": lambda crf: defaults(crf - 3),
    "in use, CRF 13": lambda crf: options_with(crf - 3, ours=True),
    "in use, CRF 10": lambda crf: options_with(crf - 6, ours=True),
}


if __name__ == "__main__":
    main()
