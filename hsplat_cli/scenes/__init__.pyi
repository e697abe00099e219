from .editor_schema import (
    SCHEMA_FILE as SCHEMA_FILE,
    SCHEMA_LINE as SCHEMA_LINE,
    schema_content as schema_content,
    write_schema as write_schema,
)
from .job import (
    SceneRequest as SceneRequest,
    load_film as load_film,
    load_job as load_job,
    read_film_record as read_film_record,
)
from .scene_text import (
    look_lines as look_lines,
    suggest_scene as suggest_scene,
    transfer_lines as transfer_lines,
    volume_place as volume_place,
)
from .shared_look import SharedLook as SharedLook
from .volume_arguments import (
    ReadingOptions as ReadingOptions,
    film_options as film_options,
    read_with_options as read_with_options,
    volume_options as volume_options,
    volume_spec as volume_spec,
)
from .volume_names import (
    base_name as base_name,
    expand_volumes as expand_volumes,
    name_volumes as name_volumes,
    own_name as own_name,
)

# isort: split
# For tests alone: steps and constants that no other room uses.
from .scene_text import compose_scene as compose_scene, yaml_string as yaml_string
