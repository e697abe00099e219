"""Read volume files: one file for each format.

In: a `VolumeSpec`. Out: a `Volume`: one step in time or a mixture of two, cropped and checked, in LPS world coordinates
where the format has them.
Sizes are checked before memory is taken, and the checksums of compressed voxels are compared.

- `volume_reading.py`: the choice of a reader, cropping and checks
- `sniff.py`: the format of a file, and the volumes in a folder
- `foreign.py`: errors for known formats that are not read, which `foreign.tsv` lists
- `headerless.py`: the shape and type in the name of a file without a header
- `image.py`: the image that every reader returns
- `axis_letters.py`: which axes of an array are of times, of components and of space
- `components.py`: the choice of a step in time and a component, and which components are light or colours
- `affines.py`: the places of voxels in the world
- `voxel_limits.py`: checks of sizes and types
- `scaled_values.py`: values from stored numbers, by a slope and an intercept
- `file_errors.py`: errors for files that cannot be read
- `statements.py`: the type of the tables of fields that change how voxels are understood, and the note on unapplied
  fields; the reader of each format has its table, `STATEMENTS`
- `nodata.py`: finds voxels without data: NaN, infinities and fill values
- `units.py`: the units of lengths and values, and the axes of the world
- `steps_in_time.py`: the number and the times of steps
- `recent_images.py`: a cache of the images that were read last; `kept_levels.py`: levels of stores in the cache folder
- `overview.py`: the level of a store by which a volume is described
- `volume_files.py`: the files of a volume, and their marks
- `voxel_colors.py`: components joined into colours
- `segments.py`: overlapping segments joined into labels, and the segments of 3D Slicer; `masks.py`: a folder of masks
- `procedural.py`: volumes from formulas, of which some have a file each: `procedural_engine_block.py`,
  `procedural_heart.py`, `procedural_vessels.py`, `procedural_cell.py`, `procedural_rock.py`, `procedural_storm.py` and
  `procedural_flower.py`; `procedural_grid.py`: their coordinates, blocks, random numbers and noise

Formats that are parsed in Python:

- `nrrd.py`, `metaimage.py`, `nifti.py` (nibabel), `mgh.py`, `mrc.py`, `numpy_arrays.py` (.npy, .npz, raw), `cube.py`:
  a file for each format
- `text_header.py`, `data_files.py`: the fields of text headers, and the data files that they name
- `stored.py`: voxels, plain or compressed

- `image_objects.py`: images in memory, of numpy, nibabel, ITK, SimpleITK, xarray and napari

Formats that a library parses, in a child process:

- `isolation.py`: the child process with its limits; `piece_journal.py`: what a process read before it was ended
- `tiff.py` (tifffile), `dicom.py` (pydicom, GDCM), `vtk_image.py` (VTK), `hdf5.py` (h5py), `pictures.py` (Pillow): a
  file for each format
- `store.py` (tensorstore): an image in levels, by the room `stores`
- `store_blocks.py`: the blocks in which a part of a level of a store is read; `level_parts.py`: a level in parts
- `slice_names.py`: the order of slices in separate files
- `orientation.py`: turned and mirrored pictures

TIFF:

- `tiff_description.py`: axes by ImageJ, OME, tifffile and Zeiss
- `tiff_spacing.py`: the lengths of voxels, by a description or the resolution
- `tiff_channels.py`: the colours, names and windows of channels
- `tiff_times.py`: the times of steps, by ImageJ and OME
- `tiff_imagej.py`: ImageJ's calibration of values and its origin
- `tiff_statements.py`, `tiff_ome.py`: other fields of a page, and of OME

VTK:

- `vtk_arrays.py`: components, and masks of hidden points and cells
- `vtk_text.py`: checks of the XML

HDF5:

- `hdf5_image.py`: the description of an image of one dataset
- `hdf5_levels.py`: an image with a dataset for each level, time and channel
- `hdf5_cf.py` (netCDF, ilastik, any dataset), `hdf5_nexus.py`, `hdf5_emd.py`, `hdf5_imaris.py`, `hdf5_bdv.py`: a file
  for each convention
- `hdf5_values.py`: the meaning of stored numbers
- `hdf5_objects.py`: groups, datasets and attributes

DICOM:

- `dicom_folder.py`: the files of one series, and the files that are left out
- `dicom_tags.py`: the fields that a search needs, without a library
- `dicom_kinds.py`: kinds of files, such as images, runs of one plane in time, tiles, and files without pixels
- `dicom_frames.py`: the frames of one file
- `dicom_fields.py`, `dicom_orientation.py`: the fields of a frame, and its directions
- `dicom_values.py`, `dicom_pixels.py`: the map from stored values to values, and decoded pixels
- `dicom_mosaic.py`: slices side by side in one image
- `dicom_places.py`: the places of frames
- `dicom_dimensions.py`: times and components among frames at one place
- `dicom_segments.py`: segments as labels
- `dicom_statements.py`: the fields that change how voxels are understood
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
