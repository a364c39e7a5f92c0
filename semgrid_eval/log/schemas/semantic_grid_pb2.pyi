# mypy: disable-error-code=type-arg
from google.protobuf import timestamp_pb2 as _timestamp_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from typing import ClassVar as _ClassVar, Iterable as _Iterable, Mapping as _Mapping, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SemanticGrid(_message.Message):
    __slots__ = ("timestamp", "frame_id", "rows", "columns", "cell_size_m", "corner_x_m", "corner_y_m", "class_ids", "class_names", "capture_time", "certainty")
    TIMESTAMP_FIELD_NUMBER: _ClassVar[int]
    FRAME_ID_FIELD_NUMBER: _ClassVar[int]
    ROWS_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    CELL_SIZE_M_FIELD_NUMBER: _ClassVar[int]
    CORNER_X_M_FIELD_NUMBER: _ClassVar[int]
    CORNER_Y_M_FIELD_NUMBER: _ClassVar[int]
    CLASS_IDS_FIELD_NUMBER: _ClassVar[int]
    CLASS_NAMES_FIELD_NUMBER: _ClassVar[int]
    CAPTURE_TIME_FIELD_NUMBER: _ClassVar[int]
    CERTAINTY_FIELD_NUMBER: _ClassVar[int]
    timestamp: _timestamp_pb2.Timestamp
    frame_id: str
    rows: int
    columns: int
    cell_size_m: float
    corner_x_m: float
    corner_y_m: float
    class_ids: bytes
    class_names: _containers.RepeatedScalarFieldContainer[str]
    capture_time: _timestamp_pb2.Timestamp
    certainty: bytes
    def __init__(self, timestamp: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., frame_id: _Optional[str] = ..., rows: _Optional[int] = ..., columns: _Optional[int] = ..., cell_size_m: _Optional[float] = ..., corner_x_m: _Optional[float] = ..., corner_y_m: _Optional[float] = ..., class_ids: _Optional[bytes] = ..., class_names: _Optional[_Iterable[str]] = ..., capture_time: _Optional[_Union[_timestamp_pb2.Timestamp, _Mapping]] = ..., certainty: _Optional[bytes] = ...) -> None: ...
