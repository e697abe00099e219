"""Drawing by several processes: `open_pool` is the door, `worker` the program of the children.

    the parent                                                       each worker
    stage -> parcel -> memory without a name, mapped by all  . . . . maps the same pages, makes a GL context
    pool: hands out numbers of frames, keeps the order  <- messages -> draws, encodes, sends record, PNG and pixels
    lifeline: a pipe that only the parent can close  . . . . . . . . ends at once when it closes

Nothing here has a name in a file system, so that nothing is left however a process ends.
"""
