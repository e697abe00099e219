"""The film job: from a scene, frames and an executor to a film and its record.

In: a `FilmJob`, a function that opens an executor, and a listener (`JobEvents`). Out: the film, its sidecar and a
`JobResult`. A film that is up to date is not drawn again, and one that was stopped resumes where it stopped.

- `film_job.py`: the film that is asked for; `film_making.py`: the job, step by step, in one pass; `refinement.py`: the
  job in several passes.
- `plan.py`: the tolerances for the accuracy that a scene requests; `forecast.py`: predicts the cost of a film;
  `trial_frames.py`: predicts it from frames that are drawn and encoded; `trial_encoding.py`: encodes some pictures.
- `executor.py`: how frames are drawn, and drawing in this process; `picture_maker.py`: the pictures of a frame.
- `output_writer.py`: writes the film, each frame while the next one is drawn, and the sidecar; `checkpoint.py`: keeps
  finished frames in files while the film is unfinished.
- `events.py`: listeners to a job: a function, a bar in a notebook, or another one.
- `inputs.py`: the files that a job reads, and folders of slices in which no output may be written.
- `assemble/`: one film of parts: `parts.py` finds them, `agreement.py` compares them, `merged_record.py` and
  `assembly.py` write the film.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
