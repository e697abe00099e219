"""Undamaged volume files of every format that is read, written by libraries of the formats or by hand, and small parts
of real ones."""

from __future__ import annotations

import gzip
import os
import re
import struct
import tempfile
import zlib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import gdcm
import nibabel
import nrrd
import numpy as np
from dicom_files import dicom_bytes, functional_groups, image_fields, save, transcode, write_slice
from pydicom import dcmread
from pydicom.dataset import Dataset
from pydicom.uid import DeflatedExplicitVRLittleEndian, ImplicitVRLittleEndian, RLELossless
from stated_dicom import segmentation
from volume_base import Array, Base, Ranges, attached, behind, detached, sample_values, written
from volume_bases_conventions import (
    convention_bases,
    masked_vtk_bases,
    stated_picture_bases,
    stated_tiff_bases,
    store_bases,
)
from volume_bases_scientific import hdf5_bases, mrc_bases, other_vtk_bases, picture_bases, written_by_vtk
from volume_bases_tiff import tiff_bases
from volume_bombs import deflated, zip_archive
from volume_files import in_memory, write_image
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkIOLegacy import vtkStructuredPointsWriter
from vtkmodules.vtkIOXML import vtkXMLImageDataWriter


@cache
def make_bases(data: Path | None) -> tuple[Base, ...]:
    """Return all undamaged volumes, in a fixed order. data: the folder of real ones, if there is one."""
    groups = (_nrrd, _metaimage, _nifti, _mgh, _arrays, _cube, tiff_bases, _dicom, _vtk)
    others = (mrc_bases, hdf5_bases, picture_bases, other_vtk_bases)
    others += (convention_bases, store_bases, masked_vtk_bases, stated_tiff_bases, stated_picture_bases)
    more = tuple(base for group in others for base in group(sample_values("int16")))
    return tuple(base for group in groups for base in group()) + more + (() if data is None else tuple(_real(data)))


def _nrrd() -> Iterator[Base]:
    values = sample_values()
    space: dict[str, Any] = {"space": "left-posterior-superior", "space origin": [1.0, 2.0, 3.0]}
    space |= {"space directions": np.diag([0.5, 0.5, 2.0]), "kinds": ["domain"] * 3}
    for encoding in ("raw", "gzip", "bzip2", "text"):
        is_guarded = encoding in ("gzip", "bzip2")
        header = {"encoding": encoding, **space}
        files = _written_by_pynrrd("a.nrrd", values, header)
        yield attached(f"nrrd {encoding} attached", files, b"\n\n", guarded=is_guarded, values=values)
        files = _written_by_pynrrd("a.nhdr", values, header)
        yield detached(f"nrrd {encoding} detached", files, "a.nhdr", guarded=is_guarded, values=values)
    lines = b"NRRD0004\n# a comment\ntype: uint16\ndimension: 3\nsizes: 10 12 4\nspacings: 0.5 0.5 2\nendian: big\n"
    digits = b"\n".join(plane.astype(">u2").tobytes().hex().encode() for plane in values)
    yield attached("nrrd hex", {"a.nrrd": lines + b"encoding: hex\n\n" + digits}, b"\n\n", guarded=False, values=values)
    names = [f"s{k}.raw.gz" for k in range(4)]
    listed = b"encoding: gzip\ndata file: LIST\n" + "\n".join(names).encode() + b"\n"
    parts = {
        name: gzip.compress(plane.astype(">u2").tobytes(), mtime=0) for name, plane in zip(names, values, strict=True)
    }
    yield detached("nrrd gzip list", {"a.nhdr": lines + listed, **parts}, "a.nhdr", guarded=True, values=values)
    plain = {f"s{k}.raw": plane.astype(">u2").tobytes() for k, plane in enumerate(values)}
    listed = b"encoding: raw\nbyte skip: -1\ndata file: s%d.raw 0 3 1 2\n"
    yield detached("nrrd raw pattern", {"a.nhdr": lines + listed, **plain}, "a.nhdr", guarded=False, values=values)
    layers = np.stack([values, values // 7], axis=-1).astype(np.uint8)
    segments = {"kinds": ["list", "domain", "domain", "domain"], "encoding": "gzip", "space": space["space"]}
    segments["space directions"] = np.vstack([np.full((1, 3), np.nan), space["space directions"]])
    segments["space origin"] = space["space origin"]
    for k, name in enumerate(("bone", "air")):
        segments |= {f"Segment{k}_ID": f"Segment_{k}", f"Segment{k}_Name": name, f"Segment{k}_Layer": str(k)}
    files = _written_by_pynrrd("a.seg.nrrd", layers, segments)
    yield attached("nrrd segmentation", files, b"\n\n", guarded=True, values=layers[..., 1], choice={"component": 1})


def _written_by_pynrrd(name: str, values: Array, header: dict[str, Any]) -> dict[str, bytes]:
    """Return the files of a volume, without the day on which they were written."""
    files = written(lambda folder: nrrd.write(str(folder / name), values, header, index_order="C"))
    return {name: re.sub(rb"(?m)^# on .*$", b"# on a day", data) for name, data in files.items()}


def _metaimage() -> Iterator[Base]:
    values = sample_values("int16")
    mark = b"ElementDataFile = "
    for is_compressed in (False, True):
        kind = "zlib" if is_compressed else "raw"
        place: dict[str, Any] = {"spacing": (0.5, 0.5, 2.0), "origin": (1.0, 2.0, 3.0), "compressed": is_compressed}
        files = written(lambda folder, place=place: write_image(folder / "a.mha", values, **place))
        yield attached(f"metaimage {kind} attached", files, mark, guarded=is_compressed, values=values)
        files = written(lambda folder, place=place: write_image(folder / "a.mhd", values, **place))
        yield detached(f"metaimage {kind} detached", files, "a.mhd", guarded=is_compressed, values=values)
    lines = b"ObjectType = Image\nNDims = 3\nDimSize = 10 12 4\nElementSpacing = 1 1 2\nElementType = MET_SHORT\n"
    text = (
        lines
        + b"BinaryData = False\nElementDataFile = LOCAL\n"
        + b"\n".join(" ".join(map(str, row)).encode() for row in values.reshape(-1, 10).tolist())
    )
    yield attached("metaimage text", {"a.mha": text}, mark, guarded=False, values=values)
    parts = {f"s{k}.raw": plane.tobytes() for k, plane in enumerate(values)}
    listed = lines + b"ElementDataFile = LIST\n" + "\n".join(parts).encode() + b"\n"
    yield detached("metaimage list", {"a.mhd": listed, **parts}, "a.mhd", guarded=False, values=values)


def _nifti() -> Iterator[Base]:
    values = sample_values("int16")
    affine = np.diag([-0.5, -0.5, 2.0, 1.0])
    for version, kind, num_header in ((1, nibabel.Nifti1Image, 352), (2, nibabel.Nifti2Image, 544)):
        image = kind(values.T, affine)
        image.header.extensions.append(nibabel.nifti1.Nifti1Extension("comment", b"a text of 20 bytes.."))
        data = written(lambda folder, image=image: image.to_filename(folder / "a.nii"))["a.nii"]
        headers = {"a.nii": ((0, num_header + 32),)}
        yield Base(f"nifti {version} plain", {"a.nii": data}, "a.nii", values=values, headers=headers)
        packed = _packed_by_gzip(data)
        yield Base(
            f"nifti {version} gzip",
            {"a.nii.gz": packed},
            "a.nii.gz",
            values=values,
            guarded={"a.nii.gz": ((0, len(packed)),)},
            headers={"": ((0, num_header + 32),)},
            pack=_packed_by_gzip,
            unpacked=data,
        )
    pair = written(lambda folder: nibabel.Nifti1Pair(values.T, affine).to_filename(folder / "a.img"))
    yield detached("nifti pair", pair, "a.hdr", guarded=False, values=values)
    pair = {f"{name}.gz": _packed_by_gzip(data) for name, data in pair.items()}
    spans = {name: ((0, len(data)),) for name, data in pair.items()}
    yield Base("nifti pair gzip", pair, "a.hdr.gz", values=values, guarded=spans)
    image = nibabel.Nifti1Image(np.stack([values, values + 1]).T, affine)
    image.header.set_slope_inter(0.5, 3)
    files = written(lambda folder: image.to_filename(folder / "a.nii"))
    yield Base("nifti time", files, "a.nii", {"time": 1}, headers={"a.nii": ((0, 352),)})
    pair = written(lambda folder: nibabel.AnalyzeImage(values.T, None, dtype="int16").to_filename(folder / "a.img"))
    yield detached("nifti analyze", pair, "a.hdr", guarded=False, values=values)


def _mgh() -> Iterator[Base]:
    values = sample_values("int16")
    data = written(lambda folder: nibabel.MGHImage(values.T, np.diag([-0.5, -0.5, 2, 1])).to_filename(folder / "a.mgh"))
    headers = {"a.mgh": ((0, 90),)}
    yield Base("mgh plain", data, "a.mgh", values=values, headers=headers)
    packed = _packed_by_gzip(data["a.mgh"])
    guarded = {"a.mgz": ((0, len(packed)),)}
    yield Base("mgh gzip", {"a.mgz": packed}, "a.mgz", values=values, guarded=guarded)


def _packed_by_gzip(data: bytes) -> bytes:
    return gzip.compress(data, 6, mtime=0)


def _arrays() -> Iterator[Base]:
    values = sample_values("float32")
    data = in_memory(np.save, values)
    headers: dict[str, Ranges] = {"a.npy": ((0, 128),)}
    yield Base("npy plain", {"a.npy": data}, "a.npy", values=values, headers=headers)
    wide = np.asfortranarray(sample_values(">u2", (2, 4, 6, 5)))
    second = wide[1].astype(np.uint16)
    yield Base("npy time", {"a.npy": in_memory(np.save, wide)}, "a.npy", {"time": 1}, second, headers=headers)
    for name, save_as in (("stored", np.savez), ("deflate", np.savez_compressed)):
        packed = in_memory(save_as, a=values)
        spans = {"a.npz": ((0, len(packed)),)}
        yield Base(f"npz {name}", {"a.npz": packed}, "a.npz", {}, values, spans, pack=_packed_by_zip, unpacked=data)
    packed = in_memory(np.savez_compressed, a=values, b=values + 1)
    spans = {"a.npz": ((0, packed.index(b"PK\1\2")),)}
    yield Base("npz two", {"a.npz": packed}, "a.npz", {"component": 1}, values + 1, spans)
    plain = sample_values("int16")
    raw = {"shape": (10, 12, 4), "dtype": "int16", "spacing": (1.0, 1.0, 2.0), "offset": 16}
    yield Base("raw", {"a.raw": bytes(16) + plain.tobytes()}, "a.raw", values=plain, raw=raw)


def _packed_by_zip(data: bytes) -> bytes:
    return zip_archive(deflated(data), size=len(data), checksum=zlib.crc32(data))


def _cube() -> Iterator[Base]:
    values = sample_values("float32", (3, 4, 7)) / 8
    for name, num_atoms, after in (("plain", 2, b""), ("orbital", -2, b"    2    5    6\n")):
        lines = b"a comment\nanother one\n%5d 0.1 0.2 0.3\n" % num_atoms
        lines += b"    7 0.5 0.0 0.0\n    4 0.0 0.5 0.0\n    3 0.0 0.0 1.0\n" + b"    6 6.0 1.0 2.0 3.0\n" * 2 + after
        stored = values if not after else np.stack([values + 1, values], axis=-1).swapaxes(0, 2)
        rows = (stored.T if not after else stored).reshape(-1, stored.shape[0] if not after else 6)
        text = "\n".join(" ".join(f"{x:.5E}" for x in row) for row in rows.tolist())
        choice = {"component": 1} if after else {}
        headers: dict[str, Ranges] = {"a.cube": ((0, len(lines)),)}
        yield Base(f"cube {name}", {"a.cube": lines + text.encode() + b"\n"}, "a.cube", choice, values, headers=headers)


def _dicom() -> Iterator[Base]:
    values = sample_values("int16")
    stack = {"PixelSpacing": ["0.5", "0.5"], "SpacingBetweenSlices": "2", "SeriesDescription": "scan"}

    yield _dicom_base("plain", dicom_bytes(image_fields(values, **stack)), values)
    yield _dicom_base("implicit", dicom_bytes(image_fields(values, **stack), ImplicitVRLittleEndian), values)
    data = dicom_bytes(image_fields(values, **stack), DeflatedExplicitVRLittleEndian)
    begin = 144 + struct.unpack_from("<I", data, 140)[0]
    content = zlib.decompress(data[begin:], -15)
    yield Base(
        "dicom deflated",
        {"a.dcm": data},
        "a.dcm",
        values=values,
        headers={"a.dcm": ((128, begin),), "": ((0, content.rindex(b"\xe0\x7f\x10\x00") + 12),)},
        pack=lambda damaged: data[:begin] + deflated(damaged),
        unpacked=content,
    )

    fields = image_fields(values, **stack)
    fields.compress(RLELossless, encoding_plugin="pydicom", generate_instance_uid=False)
    yield _dicom_base("rle", dicom_bytes(fields, RLELossless), values)
    small = sample_values("uint8", (1, 40, 36))
    kinds = ("JPEGLosslessProcess14_1", "JPEGLSLossless", "JPEG2000Lossless", "JPEGBaselineProcess1")
    for kind in kinds:

        def compressed(folder: Path, kind: str = kind) -> None:
            with tempfile.TemporaryDirectory(prefix="hsplat-fuzz-") as other:
                save(Path(other, "plain.dcm"), image_fields(small[0] if "Baseline" in kind else values, **stack))
                transcode(Path(other, "plain.dcm"), folder / "a.dcm", getattr(gdcm.TransferSyntax, kind))
            _name_again(folder / "a.dcm")

        known = None if "Baseline" in kind else values
        yield _dicom_base(kind.lower().removesuffix("lossless"), written(compressed)["a.dcm"], known)
    yield _dicom_base("enhanced", dicom_bytes(functional_groups(values, [0, 2, 1, 3]), ImplicitVRLittleEndian), values)

    def series(folder: Path) -> None:
        (folder / "series").mkdir()
        for k, plane in enumerate(values):
            write_slice(folder / "series" / f"{9 - k}.dcm", plane, (0, 0, 2 * k), axes=(1, 0, 0, 0, 1, 0))

    files = written(series)
    headers = {name: _before_pixels(data) for name, data in files.items()}
    yield Base("dicom series", files, "series", values=values.astype(np.int32), headers=headers)
    yield from _dicom_dimensions(values, stack)
    yield from _dicom_meanings(values, stack)


def _dicom_dimensions(values: Array, stack: dict[str, Any]) -> Iterator[Base]:
    """Yield files whose frames are more than slices of one volume, and of which the first volume has these values."""
    twice = np.concatenate([values, values // 2])
    slots, places = [1] * 4 + [2] * 4, [1, 2, 3, 4] * 2
    vectors = {"FrameIncrementPointer": [0x00540070, 0x00540080], "TimeSlotVector": slots, "SliceVector": places}
    detector = Dataset()
    detector.ImagePositionPatient, detector.ImageOrientationPatient = ["0"] * 3, ["1", "0", "0", "0", "1", "0"]
    fields = image_fields(twice, **stack, **vectors, DetectorInformationSequence=[detector])
    yield _dicom_base("vectors", dicom_bytes(fields), values)

    offsets = {"GridFrameOffsetVector": ["0", "2", "4", "6"], "DoseGridScaling": "0.5", "SpacingBetweenSlices": None}
    yield _dicom_base("dose", dicom_bytes(image_fields(values, **(stack | offsets))), values * 0.5)

    frames = functional_groups(twice, [0, 1, 2, 3, 4, 5, 6, 7])
    for k, frame in enumerate(frames.PerFrameFunctionalGroupsSequence):
        echo, segment = Dataset(), Dataset()
        echo.EffectiveEchoTime, segment.ReferencedSegmentNumber = 5.0 * (k // 4), 1 + k % 4 // 4
        frame.MREchoSequence, frame.SegmentIdentificationSequence = [echo], [segment]
        frame.PlanePositionSequence[0].ImagePositionPatient = ["0", "0", str(2 * (k % 4))]
    yield _dicom_base("echoes", dicom_bytes(frames), values)

    tiles = values.reshape(2, 2, 12, 10).transpose(0, 2, 1, 3).reshape(24, 20)
    mosaic = image_fields(tiles, **stack, ImageType=["ORIGINAL", "PRIMARY", "MOSAIC"], PixelPaddingValue=-2000)
    mosaic.add_new(0x00190010, "LO", "SIEMENS MR HEADER")
    mosaic.add_new(0x0019100A, "US", 4)
    yield _dicom_base("mosaic", dicom_bytes(mosaic), values)

    def times(folder: Path) -> None:
        (folder / "series").mkdir()
        for k, plane in enumerate(twice):
            place = {"ImagePositionPatient": ["0", "0", str(2 * (k % 4))], "PixelPaddingValue": -2000}
            fields = {"ImageOrientationPatient": ["1", "0", "0", "0", "1", "0"], "AcquisitionNumber": str(k // 4)}
            save(folder / "series" / f"{k}.dcm", image_fields(plane, **place, **fields))

    files = written(times)
    headers = {name: _before_pixels(data) for name, data in files.items()}
    yield Base("dicom times", files, "series", values=values, headers=headers)


def _dicom_meanings(values: Array, stack: dict[str, Any]) -> Iterator[Base]:
    """Yield files whose stored values stand for others: by a table, by a palette, by segments; and a run of times."""
    small = sample_values("uint8")
    table = np.arange(256, dtype="<u2") * 3 + 7
    item = Dataset()
    item.ModalityLUTType = "US"
    item.add_new("LUTDescriptor", "US", [256, 0, 16])
    item.add_new("LUTData", "OW", table.tobytes())
    yield _dicom_base("table", dicom_bytes(image_fields(small, **stack, ModalityLUTSequence=[item])), table[small])

    colors = np.arange(256, dtype=np.uint8)[::-1]
    palette: dict[str, Any] = {"PhotometricInterpretation": "PALETTE COLOR"}
    for color in ("Red", "Green", "Blue"):
        palette[f"{color}PaletteColorLookupTableDescriptor"] = [256, 0, 8]
        palette[f"{color}PaletteColorLookupTableData"] = colors.tobytes()
    yield _dicom_base("palette", dicom_bytes(image_fields(small, **(stack | palette))), colors[small])

    masks = np.stack([small[0] > 200, small[0] < 50])
    dataset = segmentation("BINARY", masks, SegmentLabel="Liver", RecommendedDisplayCIELabValue=[40_000] * 3)
    segments = np.select([masks[1], masks[0]], [2, 1], 0)[np.newaxis].astype(np.uint8)
    yield _dicom_base("segments", dicom_bytes(dataset), segments)

    run = image_fields(small, Modality="XA", FrameTime="33", FrameIncrementPointer=0x00181063)
    yield _dicom_base("run", dicom_bytes(run), small[:1])


def _name_again(path: Path) -> None:
    """Replace the identifiers that GDCM draws at random, and its date."""
    dataset = dcmread(path)
    dataset.StudyDate = dataset.StudyTime = ""
    for element in (*dataset.file_meta, *dataset.iterall()):
        if element.VR == "UI" and str(element.value).startswith(gdcm.UIDGenerator.GetGDCMUID()):
            element.value = "1.2.3"
    dataset.save_as(path)


def _before_pixels(data: bytes) -> Ranges:
    return ((128, data.rindex(b"\xe0\x7f\x10\x00") + 12),)


def _dicom_base(name: str, data: bytes, values: Array | None) -> Base:
    return Base(f"dicom {name}", {"a.dcm": data}, "a.dcm", values=values, headers={"a.dcm": _before_pixels(data)})


def _vtk() -> Iterator[Base]:
    values = sample_values("int16")
    image = vtkImageData()
    image.SetDimensions(values.shape[::-1])
    image.SetSpacing(0.5, 0.5, 2.0)
    for mode, compressor, is_base64 in (
        *(("Ascii", "None", False), ("Binary", "None", False), ("Binary", "ZLib", False), ("Appended", "None", False)),
        *(("Appended", "ZLib", True), ("Appended", "ZLib", False)),
        *(("Appended", "LZMA", False), ("Appended", "LZ4", False)),
    ):
        kind = f"{mode.lower()} {compressor.lower()}" + " base64" * is_base64
        yield _vtk_base(kind, image, values, mode, compressor, is_base64=is_base64)
    for name, is_binary in (("ascii", False), ("binary", True)):
        writer = vtkStructuredPointsWriter()
        writer.SetFileTypeToBinary() if is_binary else writer.SetFileTypeToASCII()
        writer.SetHeader("a title")
        data = written_by_vtk(writer, image, values)
        headers: dict[str, Ranges] = {"a.vtk": ((0, behind(b"LOOKUP_TABLE", data) + 9),)}
        yield Base(f"vtk legacy {name}", {"a.vtk": data}, "a.vtk", values=values, headers=headers)


def _vtk_base(kind: str, image: Any, values: Array, mode: str, compressor: str, *, is_base64: bool) -> Base:
    """Return an image that VTK writes as XML; blocks that are compressed by zlib or lzma have checksums."""
    writer = vtkXMLImageDataWriter()
    getattr(writer, f"SetDataModeTo{mode}")()
    getattr(writer, f"SetCompressorTypeTo{compressor}")()
    writer.SetBlockSize(512)
    writer.SetEncodeAppendedData(is_base64)
    data = written_by_vtk(writer, image, values)
    text = (
        re.search(rb"<DataArray[^>]*>\s*", data) if mode != "Appended" else re.search(rb"<AppendedData[^>]*>\s*_", data)
    )
    assert text is not None
    begin = text.end()
    num_blocks = -(-values.nbytes // 512)
    num_bytes = 4 * (3 + num_blocks)
    first = begin + (num_bytes if not (is_base64 or mode == "Binary") else -(-num_bytes // 3) * 4)
    last = data.rindex(b"</DataArray>" if mode != "Appended" else b"</AppendedData>")
    last = begin + len(data[begin:last].rstrip())
    guarded = {"a.vti": ((first, last),)} if compressor in ("ZLib", "LZMA") else {}
    headers: dict[str, Ranges] = {"a.vti": ((0, begin), (begin, min(first, last)), (last, len(data)))}
    return Base(f"vtk {kind}", {"a.vti": data}, "a.vti", values=values, guarded=guarded, headers=headers)


def _real(data: Path) -> Iterator[Base]:
    """Yield small parts of real files; of large ones the first slices."""
    for name in ("fuel", "marschnerlobb"):
        files = {file: (data / file).read_bytes() for file in (f"{name}.nhdr", f"{name}.raw.gz")}
        yield detached(f"nrrd real {name}", files, f"{name}.nhdr", guarded=True)
    head = (data / "medical/headsq_quarter.nrrd").read_bytes()
    begin = behind(b"\n\n", head)
    part = head[:begin].replace(b"64 64 93", b"64 64 3") + head[begin : begin + 3 * 64 * 64 * 2]
    yield attached("nrrd real head", {"a.nrrd": part}, b"\n\n", guarded=False)
    chest = (data / "medical/LIDC2.mha").read_bytes()
    begin = chest.index(b"\n", chest.index(b"ElementDataFile")) + 1
    packed = zlib.compress(zlib.decompress(chest[begin:])[60 * 2**16 : 61 * 2**16])
    lines = re.sub(rb"(CompressedDataSize =) \d+", rb"\1 %d" % len(packed), chest[:begin].replace(b"256 133", b"256 1"))
    yield attached("metaimage real chest", {"a.mha": lines + packed}, b"ElementDataFile = ", guarded=True)
    plain = (data / "medical/functional.nii").read_bytes()
    yield Base("nifti real time", {"a.nii": plain}, "a.nii", {"time": 3}, headers={"a.nii": ((0, 352),)})
    packed = (data / "medical/PD25_labels.nii.gz").read_bytes()
    spans = {"a.nii.gz": ((0, len(packed)),)}
    unpacked = gzip.decompress(packed)
    yield Base(
        "nifti real labels", {"a.nii.gz": packed}, "a.nii.gz", guarded=spans, headers={"": ((0, 352),)},
        pack=_packed_by_gzip, unpacked=unpacked,
    )  # fmt: skip
    names = [f"N2D_01{k}.dcm" for k in (71, 72, 73)]
    files = {f"series/{name}": (data / "medical/t1_dicom_part" / name).read_bytes() for name in names}
    headers = {name: _before_pixels(each) for name, each in files.items()}
    yield Base("dicom real series", files, "series", headers=headers)
    lines = (data / "simulation/benzene-homo.cube").read_bytes().split(b"\n")
    lines[3] = lines[3].replace(b"55", b" 2")
    text = b"\n".join(lines[:19]) + b"\n" + b"\n".join(lines[19 : 19 + 2 * 55 * 7]) + b"\n"
    yield Base("cube real", {"a.cube": text}, "a.cube", headers={"a.cube": ((0, text.index(lines[19])),)})


def real_data() -> Path | None:
    """Return the folder of real volumes that HSPLAT_TEST_DATA names."""
    folder = os.environ.get("HSPLAT_TEST_DATA")
    return Path(folder).resolve() if folder else None
