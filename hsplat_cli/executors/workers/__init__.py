"""Draws with several processes: `open_pool` starts them, `worker` is their program.

    the parent                                                       each worker
    stage -> serialised in memory without a name  . . . . . . . . .  maps the same pages, opens OpenGL
    pool: sends numbers of frames, keeps the order  <-- pipe ------> draws, encodes, sends record, PNG and pixels
    child processes: a pipe that only the parent can close  . . . .  ends at once when it closes

Nothing has a name in a file system, so nothing remains, however a process ends.
"""
