"""Pictures of tables without a scene file: everything is fitted to the data (`visray data`)."""

from visray.data_picture.picture import DataPicture, data_picture
from visray.data_picture.wishes import Wishes

__all__ = ["DataPicture", "Wishes", "data_picture"]
