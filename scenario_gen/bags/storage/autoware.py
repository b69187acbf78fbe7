# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

"""Autoware's perception messages, by definition: they are in no package index, and rosbags makes types and hashes of their text.

Fields and types as autoware_perception_msgs 1.11.0 has them for Jazzy (autowarefoundation/autoware_msgs; docs/exchange.md). The
constants are left out: neither the bytes nor the type's hash (REP 2011) know of them.
"""

PACKAGE = "autoware_perception_msgs"
PREDICTED, TRACKED = f"{PACKAGE}/msg/PredictedObjects", f"{PACKAGE}/msg/TrackedObjects"

DEFINITIONS = {
    f"{PACKAGE}/msg/ObjectClassification": """
uint8 label
float32 probability
""",
    f"{PACKAGE}/msg/Shape": """
uint8 type
geometry_msgs/Polygon footprint
geometry_msgs/Vector3 dimensions
""",
    f"{PACKAGE}/msg/PredictedPath": """
geometry_msgs/Pose[] path
builtin_interfaces/Duration time_step
float32 confidence
""",
    f"{PACKAGE}/msg/PredictedObjectKinematics": """
geometry_msgs/PoseWithCovariance initial_pose_with_covariance
geometry_msgs/TwistWithCovariance initial_twist_with_covariance
geometry_msgs/AccelWithCovariance initial_acceleration_with_covariance
PredictedPath[] predicted_paths
""",
    f"{PACKAGE}/msg/PredictedObject": """
unique_identifier_msgs/UUID object_id
float32 existence_probability
ObjectClassification[] classification
PredictedObjectKinematics kinematics
Shape shape
""",
    PREDICTED: """
std_msgs/Header header
PredictedObject[] objects
""",
    f"{PACKAGE}/msg/TrackedObjectKinematics": """
geometry_msgs/PoseWithCovariance pose_with_covariance
geometry_msgs/TwistWithCovariance twist_with_covariance
geometry_msgs/AccelWithCovariance acceleration_with_covariance
uint8 orientation_availability
bool is_stationary
""",
    f"{PACKAGE}/msg/TrackedObject": """
unique_identifier_msgs/UUID object_id
float32 existence_probability
ObjectClassification[] classification
TrackedObjectKinematics kinematics
Shape shape
""",
    TRACKED: """
std_msgs/Header header
TrackedObject[] objects
""",
}
"""Text of each message by type."""
