from .api import (
    integrate as integrate,
    load_scene as load_scene,
    preview as preview,
    render as render,
    render_frame as render_frame,
    suggest_scene as suggest_scene,
)
from .api_layers import Layer as Layer
from .api_results import (
    ExactImage as ExactImage,
    Film as Film,
    FrameImage as FrameImage,
    Page as Page,
)
from .errors import (
    HsplatError as HsplatError,
    InputError as InputError,
    OutputLockedError as OutputLockedError,
    RenderError as RenderError,
    SceneError as SceneError,
)
from .scene import FilmScene as FilmScene, Scene as Scene
