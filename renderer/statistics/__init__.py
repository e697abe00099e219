"""Measure the values of a volume, without any opinion on how they are shown.

In: a volume, and the files of a volume of labels. Out: `Statistics`, its range and histogram; `VoxelSample`, some of
its voxels, normalised; from it background, classes, labels, padding. Thresholds by Otsu 1979; matching of two scans by
Nyul and Udupa 1999.

- `histogram.py`: range, mean, histogram; `value_counts.py`: the same by counts of narrow integers; `percentiles.py`:
  exact ranks; `isolated.py`: hot and dead pixels, which are left out of the range;
  `number_text.py`: values and shares as text.
- `voxel_sample.py`: a sample of the voxels; `background.py`: the background and its noise; `padding.py`: zeros at the
  border, which are no background; `fill_value.py`: chooses the scalar that voxels without data get; `medium.py`: an
  even medium around the object; `coarse_cells.py`: voxels deep inside the visible part.
- `smoothness.py`: differences between neighbours, `spread.py`: distances from a middle, `level_crossings.py`: how often
  rays cross a level: three measurements that tell fields, scans and noise apart.
- `classes.py`: thresholds and materials; `hounsfield.py`: computed tomography; `level_sets.py`: signed distances and
  other level sets.
- `label_volume.py`: whether values are labels; `known_labels.py`: which labels there are, with names and colours.
- `matching.py`: the line by which values of one scan become values of another, by their histograms.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
