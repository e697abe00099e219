from .atomic import (
    explained as explained,
    require_possible as require_possible,
    require_writable as require_writable,
    staged_together as staged_together,
    write_staged as write_staged,
)
from .encode import find_ffmpeg as find_ffmpeg
from .frame_record import Record as Record, is_record as is_record
from .kept_frames import (
    KeptFrames as KeptFrames,
    digest as digest,
    file_digest as file_digest,
    forget_frames as forget_frames,
    is_file as is_file,
    is_frame as is_frame,
    mark_of as mark_of,
)
from .lock import alone as alone, locked as locked, require_no_other as require_no_other
from .names import (
    ANY_FRAME_FIELD as ANY_FRAME_FIELD,
    film_beside as film_beside,
    first_files as first_files,
    frame_path as frame_path,
    has_frame_files as has_frame_files,
    is_numbered as is_numbered,
    picture_files as picture_files,
    picture_shape as picture_shape,
    sidecar_of as sidecar_of,
    sidecar_path as sidecar_path,
    unfinished_folder as unfinished_folder,
)
from .picture import Picture as Picture, Pixels as Pixels
from .png import encode_png as encode_png, png_chunks as png_chunks, png_of as png_of, png_shape as png_shape
from .quantization import quantize as quantize, require_finite as require_finite
from .sidecar import write_sidecar as write_sidecar
from .stream_tail import StreamTail as StreamTail
from .writer import FilmWriter as FilmWriter, open_film as open_film, require_encoder as require_encoder
