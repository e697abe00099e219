"""Read axes from the descriptions that ImageJ, OME, tifffile and Zeiss write into the first page of a TIFF file.

ImageJ writes lines of `key=value`, tifffile JSON, and Zeiss LSM a record of numbers. OME writes XML, in which a few
attributes are searched as text: nothing is parsed, expanded or nested.
"""

from __future__ import annotations

import json
import math
import re
from dataclasses import dataclass
from typing import Any

from renderer.errors import InputError
from renderer.system import attribute, number_in, unescaped

# The largest whole number that is valid in a description.
_MAX_COUNT = 2**31 - 1
# The largest number of planes of an image in several files.
_MAX_PLANES = 2**20
# The largest number of characters of a description that a message shows.
_SHOWN_CHARACTERS = 40
# The largest number of channels of a composite image in ImageJ. A description with more channels is by tifffile, which
# calls slices channels if it is not told that the first axis is z.
_MAX_CHANNELS = 7

# The start tag of an element Pixels, which holds an image in OME's XML.
_PIXELS = re.compile(r"<(?:\w+:)?Pixels\b[^<>]*>")

# A page of a TIFF file: a tifffile.TiffPage.
Page = Any


@dataclass(frozen=True)
class Layout:
    """The arrangement of pages along axes of time, slices and components.

    axes: the axes from the slowest to the fastest: `T`, `Z`, `C`, or `-` for an axis whose first item is drawn.
    counts: the length of each axis.
    space: the axis of space, `X`, `Y` or `Z`, along a row, a column and the slices.
    note: a remark on axes that the file does not name, or None.
    """

    axes: str
    counts: tuple[int, ...]
    space: str = "XYZ"
    note: str | None = None

    def count(self, axis: str) -> int:
        """Return the length of an axis, 1 if pages do not have this axis."""
        return dict(zip(self.axes, self.counts, strict=True)).get(axis, 1)


def is_imagej(description: str) -> bool:
    """Return whether ImageJ wrote the description."""
    return description.startswith("ImageJ=")


def imagej_fields(description: str) -> dict[str, str]:
    """Return the values of the lines `key=value` in a description by ImageJ, without blanks.

    Returns an empty dict for a description by another program.
    """
    lines = description.splitlines() if is_imagej(description) else []
    pairs = (line.partition("=") for line in lines if "=" in line)
    return {key: value.strip() for key, _, value in pairs}


def is_ome(description: str) -> bool:
    """Return whether the description is OME's XML."""
    return "<OME" in description


def shaped_fields(page: Page) -> dict[str, Any]:
    """Return the unchecked fields of tifffile's description of an array, such as `shape`.

    Returns an empty dict if the page has no such description.
    """
    text: str | None = None if is_ome(page.description) or is_imagej(page.description) else page.shaped_description
    if text is None:
        return {}
    if not text.startswith("{"):  # tifffile wrote no JSON before 2016
        return {"shape": re.findall("[0-9]+", text)}
    return dict(json.loads(text))


def num_planes_by_description(page: Page) -> int:
    """Return the number of planes in the description of a file's only page, by ImageJ or tifffile."""
    if is_imagej(page.description):
        images = re.search(r"^images=([0-9]{1,9})[ \t\r]*$", page.description, re.M)
        return int(images[1]) if images else 1
    fields = shaped_fields(page)
    return math.prod(_shape(fields)) // math.prod(page.shaped) if fields.get("truncated") is True else 1


def page_layout(page: Page, num_pages: int) -> Layout:
    """Return the layout of pages by the description of the first page, or by the record of Zeiss.

    OME counts samples of a pixel as channels. Planes of OME may be in other files.
    Raises InputError if the description does not fit the number of pages, or a number in it is invalid.
    """
    description, plane = page.description, "YX"
    if is_ome(description):
        axes, counts = _ome_axes(page)
        if len({file for _, file, _ in _tiff_data(description)}) > 1 and math.prod(counts) <= _MAX_PLANES:
            num_pages = math.prod(counts)
    elif is_imagej(description):
        axes = "TZC"
        frames, channels = (_line(description, key) or 1 for key in ("frames", "channels"))
        images, slices = (_line(description, key) for key in ("images", "slices"))
        from_images = images // (frames * channels) if images else num_pages
        counts = [frames, slices or from_images, channels]
        if channels == num_pages > _MAX_CHANNELS and slices is None:
            plain = "the file calls its planes channels, more than ImageJ has; they are taken for slices"
            return Layout("Z", (num_pages,), note=plain)
    elif page.is_lsm:
        fields, axes = page.parent.lsm_metadata, "MPTZ"
        names = ("DimensionM", "DimensionP", "DimensionTime", "DimensionZ")
        counts = [max(1, int(fields.get(name, 1))) for name in names]
    elif fields := shaped_fields(page):
        axes, counts, plane = _shaped_axes(page, fields, num_pages)
    else:
        axes, counts = "Z", [num_pages]
    if math.prod(counts) != num_pages:
        expected = " x ".join(f"{n} {escaped(axis)}" for axis, n in zip(axes, counts, strict=False))
        raise _wrong("does not fit its pages", f"{num_pages} pages", expected)
    return _named(axes, counts, plane)


def _ome_axes(page: Page) -> tuple[str, list[int]]:
    """Return the axes of pages, and the length of each, for the first image in OME's XML."""
    pixels = ome_pixels(page.description)
    order = attribute(pixels, "DimensionOrder") or ""
    axes = order[:1:-1] if order[:2] == "XY" and sorted(order[2:]) == ["C", "T", "Z"] else "TZC"
    sizes = {f"Size{axis}": attribute(pixels, f"Size{axis}") for axis in axes}
    counts = [int(number("1" if text is None else text, name, least=1)) for name, text in sizes.items()]
    channels = axes.index("C")
    if counts[channels] % page.samplesperpixel == 0:
        counts[channels] //= page.samplesperpixel
    return axes, counts


def pages_of_first_image(pages: list[Page]) -> tuple[list[Page], str | None]:
    """Return the pages of OME's first image, and a note on further images; all pages of a file with one image."""
    first = pages[0]
    num_images = len(_PIXELS.findall(first.description)) if is_ome(first.description) else 1
    if num_images < 2 or len({file for _, file, _ in _tiff_data(first.description)}) > 1:
        return pages, None
    return pages[: math.prod(_ome_axes(first)[1])], f"the first of {num_images} images in this file is read"


def _shape(fields: dict[str, Any]) -> list[int]:
    return [int(number(str(n), "shape", least=1)) for n in fields["shape"]]


def _shaped_axes(page: Page, fields: dict[str, Any], num_pages: int) -> tuple[str, list[int], str]:
    """Return the axes of pages, the length of each, and the axes of one page, by tifffile's description.

    If a file has several arrays of one shape, these are a further axis. If the pages do not fit the array, all axes of
    the array are returned.
    """
    shape, plane = _shape(fields), [n for n in page.shaped if n > 1]
    axes = str(fields.get("axes") or "Q" * len(shape)).upper()
    # A page has the last axes of the array; axes of length 1 may lie anywhere between these.
    splits = [k for k in range(max(1, len(shape) - 1)) if [n for n in shape[k:] if n > 1] == plane]
    is_fit = splits and len(axes) == len(shape) and not any(axes.count(axis) > 1 for axis in "TZC")
    split = splits[-1] if is_fit else len(shape)
    num_arrays = max(1, num_pages // math.prod(shape[:split]))
    return "Q" + axes[:split], [num_arrays, *shape[:split]], "".join(re.findall("[XYZ]", axes[split:]))


def _named(axes: str, counts: list[int], plane: str) -> Layout:
    """Return a layout in which axes with other names become z, time or components.

    The last axis with another name becomes z, unless the file has an axis z. All others become times and components.
    plane: the two axes of a page, such as `YX`: down its columns, and along its rows.
    """
    letters = [axis for axis, n in zip(axes, counts, strict=True) if n > 1]
    others = [k for k, axis in enumerate(letters) if axis not in "TZC"]
    slices = "Z"
    if "Z" not in letters and others:
        slices, letters[others[-1]] = letters[others[-1]], "Z"
        others.pop()
    for k, letter in zip(others, [*sorted({"T", "C"} - {*letters}, reverse=True), *"-" * len(others)], strict=False):
        letters[k] = letter
    space = plane[::-1] + (slices if slices in "XY" else "Z")
    space = space if sorted(space) == ["X", "Y", "Z"] else "XYZ"
    note = "the file does not say which axes are times and components; those before z, y and x are taken for them"
    return Layout("".join(letters), tuple(n for n in counts if n > 1), space, note if others else None)


def page_places(description: str, own_name: str, layout: Layout) -> list[tuple[str, int]]:
    """Return the file and the page number of each plane, in the order of the layout.

    OME's TiffData elements may place planes on any page, also in files beside this one. An empty name stands for this
    file. own_name: the name of this file, which may have been renamed. Raises InputError unless each plane has a page
    of its own.
    """
    root, elements = re.search(r"<(?:\w+:)?OME\b([^<>]*)>", description), _tiff_data(description)
    own_uuid = (root and attribute(root[1], "UUID")) or None
    is_alone = len({file for _, file, _ in elements}) < 2
    places = [("", k) for k in range(math.prod(layout.counts))]
    for element, file, uuid in elements:
        found = {
            name: int(number(text, name, least=0))
            for name in ("IFD", "PlaneCount", "FirstT", "FirstZ", "FirstC")
            if (text := attribute(element, name)) is not None
        }
        plane = 0
        for axis, count in zip(layout.axes, layout.counts, strict=True):
            plane = plane * count + found.get(f"First{axis}", 0)
        if "IFD" in found or not is_alone:
            begin, most = found.get("IFD", 0), len(places) - plane
            for k in range(min(found.get("PlaneCount", 1 if "IFD" in found else most), most)):
                is_own = is_alone or file == own_name or uuid == own_uuid
                places[plane + k] = ("" if is_own else file, begin + k)
    if len(set(places)) < len(places) or (is_alone and max(places)[1] >= len(places)):
        expected = f"TiffData elements for {len(places)} pages" + ", all in this file" * is_alone
        raise _wrong("does not give each plane a page", None, expected)
    return places


def _tiff_data(description: str) -> list[tuple[str, str, str]]:
    """Return the attributes, the file and the UUID of each TiffData element of OME's first image.

    The name of the file comes without folders. File and UUID are empty if the element names no file.
    """
    image = re.split(r"</(?:\w+:)?Pixels\b", description, maxsplit=1)[0]
    found = []
    for text in re.split(r"<(?:\w+:)?TiffData\b", image)[1:]:
        attributes, _, content = text.partition(">")
        uuid = re.search(r"<(?:\w+:)?UUID\b([^<>]*)>([^<]*)", content)
        file = unescaped(attribute(uuid[1], "FileName") or "") if uuid else ""
        found.append((attributes, re.split(r"[/\\]", file)[-1], uuid[2].strip() if uuid else ""))
    return found


def ome_elements(description: str, name: str) -> list[str]:
    """Return the attributes of each element called `name` in the first image of OME's XML."""
    image = re.split(r"</(?:\w+:)?Pixels\b", description, maxsplit=1)[0]
    return re.findall(rf"<(?:\w+:)?{name}\b([^<>]*)>", image)


def ome_pixels(description: str) -> str:
    """Return the tag of the first Pixels element of OME's XML; the whole XML if there is none."""
    found = _PIXELS.search(description)
    return found[0] if found else description


def _line(description: str, key: str) -> int | None:
    found = re.search(rf"^{key}=(\S*)", description, re.M)
    return int(number(found[1], key, least=1)) if found else None


def number(text: str, key: str, least: int | None = None) -> float:
    """Return the number in `text`, the value of `key`; raises InputError for any other text.

    least: None for any finite number, else the least of the valid whole numbers.
    """
    value = number_in(text)
    if math.isfinite(value) if least is None else value.is_integer() and least <= value <= _MAX_COUNT:
        return value
    expected = "a finite number" if least is None else f"a whole number from {least} to {_MAX_COUNT}"
    raise _wrong("has something else where a number belongs", f"{key}={escaped(text)}", expected)


def _wrong(how: str, got: str | None, expected: str) -> InputError:
    hint = "save it again as a plain stack, all slices in one file"
    return InputError(f"the description in this TIFF file {how}", got=got, expected=expected, hint=hint)


def escaped(text: str) -> str:
    """Return a text for one line of a message, with letters outside ASCII escaped."""
    return ascii(text[:_SHOWN_CHARACTERS])[1:-1] + "..." * (len(text) > _SHOWN_CHARACTERS)
