"""What rosbag2 writes beside the messages of a topic: its quality of service and the hash of its type (REP 2016)."""

from __future__ import annotations

TYPE_HASHES = {
    "sensor_msgs/msg/Image": "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    "sensor_msgs/msg/CameraInfo": "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    "geometry_msgs/msg/PoseStamped": "10f3786d7d40fd2b54367835614bff85d4ad3b5dab62bf8bca0cc232d73b4cd8",
    "sensor_msgs/msg/JointState": "a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e",
    "std_msgs/msg/Bool": "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    "std_msgs/msg/String": "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}
_FOREVER = "{sec: 9223372036, nsec: 854775807}"


def _profile(latched: bool) -> str:
    """As rosbag2 has it, YAML. latched: who subscribes later gets the last message still."""
    return (
        f"- history: keep_last\n  depth: {1 if latched else 10}\n  reliability: reliable\n"
        f"  durability: {'transient_local' if latched else 'volatile'}\n"
        f"  deadline: {_FOREVER}\n  lifespan: {_FOREVER}\n  liveliness: automatic\n"
        f"  liveliness_lease_duration: {_FOREVER}\n  avoid_ros_namespace_conventions: false\n"
    )


def channel_metadata(kind: str, latched: bool) -> dict[str, str]:
    """The metadata of an MCAP channel of messages of a kind."""
    return {"offered_qos_profiles": _profile(latched), "topic_type_hash": f"RIHS01_{TYPE_HASHES[kind]}"}
