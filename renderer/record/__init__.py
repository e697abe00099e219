"""What is known of a film: its record, from the rays and frames to the sidecar and to words.

In: frames that were drawn and measured, or the sidecar of a film. Out: records, their JSON and their sentences; whether
a film is up to date, reached its goal, and is what its sidecar says.

- `film_record.py`: the records of films and frames, to JSON and back; `make_record.py`: makes them; `sidecar.py`: the
  file.
- `accuracy_records.py`: how exact frames and film are, in records and words; `visibility_records.py`: what they show;
  `goals.py`: whether a film reached what its scene requested.
- `citation.py`: how a film was made, in words for a paper, and BibTeX.
- `fingerprint.py`: what frames depend on; `finished_film.py`: the film that is there;
  `own_files.py`: whether files that are there are its own.
- `verification.py`: whether a finished film is what its sidecar says; `verified_accuracy.py`: by exact rays.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
