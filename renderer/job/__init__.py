"""The film job: from a scene, frames and an executor to a film and its record.

In: a `FilmJob`, what opens an executor, and a listener (`JobEvents`). Out: the film, its sidecar and a `FinishedFilm`.
A film that is up to date is not drawn again, and one that was stopped resumes where it stopped.

- `film_job.py`: what is to be made, perhaps again.
- `film_making.py`: the job, step by step, in one pass; `refinement.py`: in several.
- `forecast.py`: what a film costs here, from frames that are drawn and encoded.
- `output_writer.py`: the loop over frames, each of which is stored while the next one is drawn; and the sidecar.
- `plan.py`: the tolerances for what a scene requests.
- `executor.py`: what draws, and drawing in this process; `picture_maker.py`: the pictures of a frame that outputs need,
  and what the annotation over them shows.
- `events.py`: what a job tells while it runs, to a function, a bar in a notebook, or another listener.
- `checkpoint.py`: finished frames; those of an unfinished film are kept in files.
- `inputs.py`: the files that are read, and folders that no output joins.
- `assemble/`: one film of parts: `parts.py` finds them, `agreement.py` compares them, `merged_record.py` and
  `assembly.py` write the film.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
