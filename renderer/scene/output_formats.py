"""The formats of pictures and films: the one table that knows their suffixes, encoders, alpha, bit depths and limits.

All films are written and read by ffmpeg, whose names and options these are. A new format is an entry here.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Literal

# The option of encoders for the same 4 threads on every machine: the bytes of a film may depend on the number of
# threads, which by default is the number of cores.
_THREADS = ("-threads", "4")
# The settings of x264. Its defaults keep the look of grain, which renderings do not have, at the cost of exact pixels.
# With these settings, films of three scans were 0.4 to 0.7 dB closer to their frames at equal size. Without adaptive
# quantisation (AQ) they would be closer still, but at quality 2 a third of the black background would not be black.
_X264_PARAMS = "psy=0:aq-strength=0.7:chroma-qp-offset=-4"
_X265_PARAMS = "log-level=error:pools=4:frame-threads=1:psy-rd=0:psy-rdoq=0"


@dataclass(frozen=True)
class Codec:
    """An encoder of ffmpeg, with its options.

    pixel_formats: its pixel formats for opaque pictures, the default first. with_alpha: its pixel formats for
        transparent pictures, the default first; empty if it has none.
    crf: the constant rate factor at quality 0, and the amount by which the factor falls with each step of quality; None
        for an encoder without such a factor.
    kept_psnr: the typical PSNR of films at quality 8 against their frames, in decibels, and the gain of each step of
        quality. H.264 kept 44.5 dB over many scans; the differences of other encoders from H.264 were measured on
            three scans.
    marks: texts, one of which is in the first bytes of each film of this encoder.
    decoder: the decoder of its films, if that is not ffmpeg's default.
    has_percent_quality: whether its scale of quality ends at 100, and not at 10.
    has_dpi: whether its films state a resolution in pixels per inch.
    merges_frames: whether equal consecutive pictures become one picture that is shown for longer.
    full_chroma_players: the programs that play its films with chroma of full resolution, and others that do not.
    """

    encoder: str
    pixel_formats: tuple[str, ...]
    kept_psnr: tuple[float, float]
    options: tuple[str, ...] = ()
    with_alpha: tuple[str, ...] = ()
    crf: tuple[float, float] | None = None
    marks: tuple[bytes, ...] = ()
    decoder: str | None = None
    has_percent_quality: bool = False
    merges_frames: bool = False
    has_dpi: bool = False
    full_chroma_players: str = ""


_H264 = Codec(
    "libx264", ("yuv420p", "yuv444p"), (44.5, 1.4), ("-preset", "medium", *_THREADS, "-x264-params", _X264_PARAMS),
    crf=(40, 3), marks=(b"avc1",),
    full_chroma_players="Chrome, VLC and mpv play it; Firefox, Safari and most devices do not",
)  # fmt: skip
_HEVC = Codec(
    "libx265", ("yuv420p", "yuv420p10", "yuv444p"), (44.5, 1.5),
    ("-preset", "medium", "-x265-params", _X265_PARAMS, "-tag:v", "hvc1"),
    ("yuva420p",), (40, 3), (b"hvc1",),
    full_chroma_players="VLC and mpv play it; most browsers and devices do not",
)  # fmt: skip
_VP9 = Codec(
    "libvpx-vp9", ("yuv420p", "yuv420p10", "yuv444p"), (44.5, 1.2),
    ("-b:v", "0", "-deadline", "good", "-cpu-used", "2", "-row-mt", "1", *_THREADS), ("yuva420p",), (60, 5),
    (b"V_VP9",), "libvpx-vp9",
    full_chroma_players="Chrome, Firefox, VLC and mpv play it; Safari and most devices do not",
)  # fmt: skip
_AV1 = Codec(
    "libaom-av1", ("yuv420p", "yuv420p10", "yuv444p"), (43.5, 1.1),
    ("-cpu-used", "6", "-row-mt", "1", *_THREADS), crf=(60, 5), marks=(b"av01", b"V_AV1"),
    full_chroma_players="Chrome, Firefox, VLC and mpv play it; Safari and most devices do not",
)  # fmt: skip
_STILL_AV1 = Codec("libaom-av1", ("yuv444p", "yuv420p"), (45.5, 1.2), _AV1.options, ("yuva444p", "yuva420p"), _AV1.crf)
_PRORES = Codec(
    "prores_ks", ("yuv444p10",), (62.0, 0.0), ("-profile:v", "4", "-vendor", "apl0", "-alpha_bits", "16"),
    ("yuva444p10",), marks=(b"ap4h",),
)  # fmt: skip
_GIF = Codec("gif", ("pal8",), (49.0, 0.0))
_WEBP = Codec(
    "libwebp_anim", ("yuv420p",), (42.0, 1.0), with_alpha=("yuva420p",), has_percent_quality=True, merges_frames=True
)
_LOSSLESS_WEBP = Codec("libwebp_anim", ("bgra",), (100.0, 0.0), ("-lossless", "1"), ("bgra",), merges_frames=True)
_APNG = Codec("apng", ("rgb24",), (100.0, 0.0), with_alpha=("rgba",), has_dpi=True)


@dataclass(frozen=True)
class OutputFormat:
    """A format of pictures or films.

    name: the format's name, with an article. begins, ends: the first and the last bytes of a file.
    codecs: the encoders by their names in scenes, the default first; empty if each frame is a file.
    pixel_formats: the pixel formats of a format in which each frame is a file.
    muxer, demuxer: ffmpeg's options for writing the format, and ffmpeg's name of the reader of the format.
    filters: the conversion before encoding: to YUV in the `limited` or the `full` range, to a `palette`, or none.
    has_alpha_plane: whether a file holds alpha as a second film.
    max_rate: the most frames per second. ticks_per_second: the unit of delays, which are whole numbers of ticks.
    """

    name: str
    media_type: str
    begins: re.Pattern[bytes]
    codecs: Mapping[str, Codec] = field(default_factory=dict)
    pixel_formats: tuple[str, ...] = ()
    muxer: tuple[str, ...] = ()
    demuxer: str = ""
    filters: Literal["limited", "full", "palette", ""] = "limited"
    has_alpha_plane: bool = False
    ends: bytes = b""
    max_rate: float | None = None
    ticks_per_second: int | None = None

    @property
    def is_frames(self) -> bool:
        """Return whether each frame is a separate file, which exists as soon as it is drawn."""
        return not self.codecs

    @property
    def has_alpha(self) -> bool:
        """Return whether pictures may be transparent, with the format's default encoder."""
        return self.is_frames or bool(next(iter(self.codecs.values())).with_alpha)


# The first bytes of files of the ISO base media format: MP4, MOV and AVIF.
_ISO_FILE = re.compile(rb"....ftyp", re.DOTALL)
# The first bytes of PNG and APNG files.
_PNG_FILE = re.compile(rb"\x89PNG\r\n\x1a\n")
_ISO_OPTIONS = ("-movflags", "+faststart")

FORMATS: Mapping[str, OutputFormat] = {
    ".mp4": OutputFormat(
        "an MP4", "video/mp4", _ISO_FILE, {"h264": _H264, "hevc": _HEVC, "av1": _AV1},
        muxer=(*_ISO_OPTIONS, "-f", "mp4"), demuxer="mov",
    ),
    ".webm": OutputFormat(
        "a WebM", "video/webm", re.compile(rb"\x1aE\xdf\xa3"), {"vp9": _VP9, "av1": _AV1},
        muxer=("-f", "webm"), demuxer="matroska",
    ),
    ".mov": OutputFormat(
        "a MOV", "video/quicktime", _ISO_FILE, {"prores": _PRORES, "hevc": _HEVC, "h264": _H264},
        muxer=(*_ISO_OPTIONS, "-f", "mov"), demuxer="mov",
    ),
    # A GIF's delay is a whole number of hundredths of a second. Browsers show a delay of up to 10 ms as one of 100 ms.
    ".gif": OutputFormat(
        "a GIF", "image/gif", re.compile(rb"GIF8[79]a"), {"gif": _GIF}, muxer=("-loop", "0", "-f", "gif"),
        demuxer="gif", filters="palette", ends=b";", max_rate=50, ticks_per_second=100,
    ),
    ".webp": OutputFormat(
        "a WebP", "image/webp", re.compile(rb"RIFF....WEBP", re.DOTALL), {"webp": _WEBP, "lossless": _LOSSLESS_WEBP},
        muxer=("-loop", "0", "-f", "webp"), demuxer="webp_anim", filters="", max_rate=90,
    ),
    ".apng": OutputFormat(
        "an APNG", "image/apng", _PNG_FILE, {"apng": _APNG}, muxer=("-plays", "0", "-f", "apng"), demuxer="apng",
        filters="", max_rate=90,
    ),
    ".avif": OutputFormat(
        "an AVIF", "image/avif", _ISO_FILE, {"av1": _STILL_AV1}, muxer=("-f", "avif"), demuxer="mov", filters="full",
        has_alpha_plane=True,
    ),
    ".png": OutputFormat("PNG frames", "image/png", _PNG_FILE, pixel_formats=("rgb24", "rgb48")),
    ".exr": OutputFormat("EXR frames", "image/x-exr", re.compile(rb"v/1\x01"), pixel_formats=("float",)),
}  # fmt: skip

FILM_SUFFIXES = tuple(suffix for suffix, each in FORMATS.items() if not each.is_frames)
FRAME_SUFFIXES = tuple(suffix for suffix, each in FORMATS.items() if each.is_frames)


def output_suffix(file: PurePath | str) -> str:
    """Return the suffix of a file, in lower case, which determines the file's format. It may be an unknown one."""
    return PurePath(file).suffix.lower()


def format_of(file: PurePath | str) -> OutputFormat:
    """Return the format of a file. Raises KeyError for an unknown suffix."""
    return FORMATS[output_suffix(file)]
