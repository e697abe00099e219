from .film_arguments import (
    as_arguments as as_arguments,
    default_output as default_output,
    film_options as film_options,
)
from .job import Job as Job, load_job as load_job
from .scene_text import (
    FilmOptions as FilmOptions,
    transfer_lines as transfer_lines,
    volume_file as volume_file,
)
from .sidecar_file import (
    Sidecar as Sidecar,
    is_shallow as is_shallow,
    load_json_object as load_json_object,
    parse_sidecar as parse_sidecar,
    read_known_fields as read_known_fields,
    text_at as text_at,
)
from .suggested_scene import (
    SuggestedScene as SuggestedScene,
    suggest_scene as suggest_scene,
)
from .truncation_guard import guard_mapping as guard_mapping, read_volume_guarded as read_volume_guarded
from .volume_arguments import (
    read_with_options as read_with_options,
    volume_options as volume_options,
    volume_spec as volume_spec,
)
from .volume_names import (
    base_name as base_name,
    expand_pattern as expand_pattern,
    expand_volumes as expand_volumes,
    name_volumes as name_volumes,
)
