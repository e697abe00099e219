"""Read volume files: one file for each format.

In: a `VolumeSpec`. Out: `Volume`, one step in time or between two, cropped and checked, in LPS world coordinates where
the format has them.
Sizes are checked before memory is taken, and all compressed voxels with a checksum are compared with it.

- `volume_reading.py` chooses the reader, crops and checks; `recent_images.py` keeps steps of DICOM; `nodata.py`: which
  voxels have no data; `sniff.py` finds formats and volumes in folders; `foreign.py` names files that are not read, by
  `foreign.tsv`; `headerless.py`: what the name of a file without a header tells of its voxels; `voxel_colors.py` joins
  the components of colours, and `segments.py` segments that overlap.
- `image.py` is what every reader returns; `components.py`: which step in time and component are read, and which are
  light or colours; `affines.py`: places of voxels in the world; `voxel_limits.py`: checks of sizes and types;
  `scaled_values.py`: values of stored numbers; `file_errors.py`: files that cannot be read.
- `nrrd.py`, `metaimage.py`, `nifti.py` (nibabel), `mgh.py`, `mrc.py`, `numpy_arrays.py` (.npy, .npz, raw), `cube.py`:
  parsed in Python; `text_header.py` and `data_files.py`: fields and files of text headers; `stored.py` reads and
  decompresses voxels.
- `isolation.py`: a child process with limits for `tiff.py` (tifffile), `dicom.py` (pydicom, GDCM), `vtk_image.py`,
  `hdf5.py` (h5py) and `pictures.py` (Pillow); `slice_names.py`: the order of slices in separate files;
  `orientation.py`: pictures that are turned.
- `tiff_description.py`: axes by ImageJ, OME, tifffile and Zeiss; `tiff_spacing.py`: lengths by them or the resolution;
  `tiff_channels.py`: colours, names and windows of channels; `tiff_imagej.py`: calibrated values and the origin;
  `tiff_statements.py` and `tiff_ome.py`: what else fields of a page, and OME, state.
- `vtk_arrays.py`: components, and masks of what is hidden; `vtk_text.py` checks the XML of an image.
- `hdf5_image.py`: an image as a convention of HDF5 describes it, a file for each: `hdf5_cf.py` (netCDF, ilastik, any
  dataset), `hdf5_nexus.py`, `hdf5_emd.py`, `hdf5_imaris.py`, `hdf5_bdv.py`; `hdf5_values.py`: what stored numbers mean;
  `hdf5_objects.py`: groups, datasets and attributes.
- `dicom_folder.py`: the files of one series, and strays; `dicom_tags.py`: fields that a search needs; `dicom_kinds.py`:
  runs, tiles and files without pixels; `dicom_frames.py`: the frames of one file, by its fields, `dicom_fields.py` and
  `dicom_orientation.py`; `dicom_values.py` and `dicom_pixels.py`: their values; `dicom_mosaic.py`: slices side by side
  in one image; `dicom_places.py`: where frames lie; `dicom_dimensions.py`: times and components among those at one
  place; `dicom_segments.py`: labels; `dicom_statements.py`: what else files state.
- `steps_in_time.py`: how many steps there are in time, and when; `tiff_times.py`: by ImageJ and OME.
- `statements.py`: tables of the fields that change how voxels are understood, and the note on those that are not
  applied.
- `units.py`: of lengths and values, and what the axes of the world point to.
- `procedural.py`: volumes from formulas.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
