"""Pictures of tables without a scene file: everything is fitted to the data (`visray data` and `vr.data_scene`)."""

from visray.data_picture.in_python import data_scene
from visray.data_picture.picture import DataPicture, data_picture
from visray.data_picture.wishes import Wishes

__all__ = ["DataPicture", "Wishes", "data_picture", "data_scene"]
