from .atomic import (
    require_writable as require_writable,
    require_writable_dry_run as require_writable_dry_run,
    staged_files as staged_files,
    sync_to_disk as sync_to_disk,
    translate_os_errors as translate_os_errors,
    write_staged as write_staged,
)
from .decode import (
    count_film_frames as count_film_frames,
    decode_film as decode_film,
    decode_known_film as decode_known_film,
)
from .digests import (
    bytes_digest as bytes_digest,
    data_digest as data_digest,
    file_digest as file_digest,
    file_matches_digest as file_matches_digest,
    frame_matches_digest as frame_matches_digest,
)
from .encode import Ffmpeg as Ffmpeg, describe_ffmpeg as describe_ffmpeg
from .lock import (
    lock_slots as lock_slots,
    locked_files as locked_files,
    locked_output as locked_output,
    require_own_folder as require_own_folder,
)
from .names import (
    ANY_FRAME_FIELD as ANY_FRAME_FIELD,
    film_path_of_sidecar as film_path_of_sidecar,
    film_sidecars as film_sidecars,
    frame_path as frame_path,
    picture_files as picture_files,
    sidecar_path as sidecar_path,
    sidecar_path_of_file as sidecar_path_of_file,
    unfinished_folder as unfinished_folder,
)
from .picture import (
    Picture as Picture,
    Pixels as Pixels,
    over_black as over_black,
    picture_layout as picture_layout,
)
from .png import (
    decode_png as decode_png,
    encode_png as encode_png,
    join_png_chunks as join_png_chunks,
    png_chunks as png_chunks,
)
from .quantization import (
    behind_rows as behind_rows,
    over_background as over_background,
    over_rows as over_rows,
    quantize as quantize,
    reduce_radiance as reduce_radiance,
    require_finite as require_finite,
    rounded as rounded,
)
from .runs import consecutive_ranges as consecutive_ranges
from .stream_tail import StreamTail as StreamTail
from .writer import (
    WriteFrame as WriteFrame,
    film_notes as film_notes,
    open_films as open_films,
    require_encoder as require_encoder,
)
from .written_files import (
    WrittenFiles as WrittenFiles,
    film_files as film_files,
    folder_files as folder_files,
    require_no_input as require_no_input,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .atomic import remove_temporaries as remove_temporaries
from .encode import open_encoder as open_encoder
from .exr import decode_exr as decode_exr
