from .field import LightField as LightField, light_field as light_field
from .rays import fill_light as fill_light
