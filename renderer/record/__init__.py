"""All that is known of a film: records of its frames and of the whole, its sidecar, and sentences about it.

In: frames that are drawn and measured, or the sidecar of a film. Out: records, their JSON and their words; whether a
film is up to date, reached the requested accuracy, and agrees with its sidecar.

- `record_file.py`: reads and writes files of records, of any kind; `field_types.py`: the types of their fields.
- `film_record.py`: the records of films and frames; `record_making.py`: makes them, with notes; `rounding.py`: rounds
  their numbers; `sidecar.py`: the file of a film's record.
- `accuracy_records.py`: how exact frames and films are, in records and words; `visibility_records.py`: which scalars
  they show; `goals.py`: whether a film has the accuracy that was requested; `file_limits.py`: what would make its
  file more exact.
- `citation.py`: how a film was made, in words for a paper, and BibTeX.
- `up_to_date.py`: whether something that was made is up to date, and why not; `fingerprint.py`: all that a film depends
  on; `finished_film.py`: a film that is made; `picture_files.py`: whether its pictures are unchanged; `own_files.py`:
  whether a film has made the files of its outputs.
- `verification.py`: whether a finished film agrees with its sidecar; `verified_accuracy.py`: its accuracy, measured
  again by exact rays.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
