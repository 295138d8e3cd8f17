"""The ROS 2 message definitions that an MCAP file carries, so that its readers need no ROS (common_interfaces)."""

_PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "sensor_msgs/PointField": (
        "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 FLOAT32=7\n"
        "uint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count"
    ),
    "sensor_msgs/RegionOfInterest": ("uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify"),
    "geometry_msgs/TransformStamped": (
        "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform"
    ),
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
}
_HEADER = ("std_msgs/Header", "builtin_interfaces/Time")


def _text(own: str, *parts: str) -> str:
    blocks = [own, *(f"{'=' * 80}\nMSG: {part}\n{_PARTS[part]}" for part in parts)]
    return "\n".join(blocks) + "\n"


POINT_CLOUD = "sensor_msgs/msg/PointCloud2"
IMAGE = "sensor_msgs/msg/Image"
CAMERA_INFO = "sensor_msgs/msg/CameraInfo"
TRANSFORMS = "tf2_msgs/msg/TFMessage"
IMU = "sensor_msgs/msg/Imu"
JOINTS = "sensor_msgs/msg/JointState"
POINT = "geometry_msgs/msg/PointStamped"
VECTOR = "geometry_msgs/msg/Vector3Stamped"
QUATERNION = "geometry_msgs/msg/QuaternionStamped"

DEFINITIONS = {
    POINT_CLOUD: _text(
        "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] fields\nbool is_bigendian\n"
        "uint32 point_step\nuint32 row_step\nuint8[] data\nbool is_dense",
        *_HEADER,
        "sensor_msgs/PointField",
    ),
    IMAGE: _text(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\n"
        "uint8[] data",
        *_HEADER,
    ),
    CAMERA_INFO: _text(
        "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n"
        "float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi",
        *_HEADER,
        "sensor_msgs/RegionOfInterest",
    ),
    TRANSFORMS: _text(
        "geometry_msgs/TransformStamped[] transforms",
        "geometry_msgs/TransformStamped",
        *_HEADER,
        "geometry_msgs/Transform",
        "geometry_msgs/Vector3",
        "geometry_msgs/Quaternion",
    ),
    IMU: _text(
        "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
        "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
        "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
        *_HEADER,
        "geometry_msgs/Quaternion",
        "geometry_msgs/Vector3",
    ),
    JOINTS: _text(
        "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort", *_HEADER
    ),
    POINT: _text("std_msgs/Header header\ngeometry_msgs/Point point", *_HEADER, "geometry_msgs/Point"),
    VECTOR: _text("std_msgs/Header header\ngeometry_msgs/Vector3 vector", *_HEADER, "geometry_msgs/Vector3"),
    QUATERNION: _text(
        "std_msgs/Header header\ngeometry_msgs/Quaternion quaternion", *_HEADER, "geometry_msgs/Quaternion"
    ),
}


def define_message(fields: str) -> str:
    """Return the definition of a message of our own that has a header."""
    return _text(fields, *_HEADER)
