"""Read volume files: one reader for each family of formats.

In: a `VolumeSpec`. Out: `Volume`, cropped, checked and finite, in LPS world coordinates where the format has them.
Headers are checked before a library reads them and before memory is allocated.

- `read.py` chooses the reader and crops, checks and replaces NaN; `sniff.py` rejects files that are not volumes;
  `common.py` has the checks that hold for all formats.
- `itk.py`: NRRD and MetaImage by SimpleITK; `headers.py`: their headers, checked first. `nifti.py`: NIfTI.
- `dicom.py`: a DICOM series and its affine; `dicom_header.py`: checks of its headers. `arrays.py`: .npy and raw voxels.
- `tiff.py`: TIFF files and stacks; `tiff_directory.py`: their pages; `tiff_description.py`: axes and spacing by ImageJ
  and OME. `slice_names.py`: the order of slices in separate files. `procedural.py`: volumes from formulas.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
