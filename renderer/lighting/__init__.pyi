from .field import light_field as light_field
