# SPDX-FileCopyrightText: 2026 The scenario_gen authors
# SPDX-License-Identifier: Apache-2.0

# Service calls with their answers: each line below a call is what it answers, `…` is any text.
# With LOG=scenario_gen/resources/synthetic_c and
# ros2 run scenario_gen suite --ros-args -p log_path:=$LOG -p road_name:=straight \
#   -p wait_for_tracks:=true -p count:=3 -p seed:=7
ros2 service call /gp_sampler/wait_until_ready std_srvs/srv/Trigger
# {success: true, message: ready}
ros2 service call /gp_sampler/generate rcl_interfaces/srv/SetParametersAtomically "{parameters: [{name: count, value: {type: 2, integer_value: 5}}, {name: ego, value: {type: 4, string_value: '1'}}]}"
# {result: {successful: true, reason: 'request 2: 5 of 5 scenarios from … candidates'}}
ros2 service call /gp_sampler/generate rcl_interfaces/srv/SetParametersAtomically "{parameters: [{name: request, value: {type: 4, string_value: trial_a}}, {name: ego, value: {type: 4, string_value: '9'}}]}"
# {result: {successful: false, reason: 'request trial_a: … there are: 1, 2'}}
ros2 service call /segmenter/segment std_srvs/srv/Trigger
# {success: true, message: started}
ros2 service call /road_server/get_map nav_msgs/srv/GetMap
# {map: {header: {frame_id: map}, info: {width: 587, height: 55}}}
ros2 service call /road_server/load_map nav_msgs/srv/LoadMap "{map_url: 'file:///no/such/map.yaml'}"
# {result: 1}
ros2 service call /road_server/load_map nav_msgs/srv/LoadMap "{map_url: straight}"
# {result: 0, map: {info: {width: 587}}}
ros2 service call /log_player/play std_srvs/srv/Trigger
# {success: true, message: started}
ros2 service call /recorder/start std_srvs/srv/Trigger
# {success: true, message: bag_…}
ros2 service call /recorder/stop std_srvs/srv/Trigger
# {success: true, message: bag_…}
ros2 service call /gp_sampler/cancel std_srvs/srv/Trigger
# {success: false, message: nothing is running}

# A path, and an impossible one. A stamp in `start` identifies your request.
ros2 service call /planner/get_plan nav_msgs/srv/GetPlan "{start: {header: {stamp: {sec: 1}}, pose: {position: {x: 10, y: 3.75}}}, goal: {pose: {position: {x: 100, y: 3.75}}}}"
# {plan: {header: {stamp: {sec: 1}, frame_id: map}}}
ros2 service call /planner/get_plan nav_msgs/srv/GetPlan "{start: {header: {stamp: {sec: 2}}, pose: {position: {x: 10, y: 3.75}}}, goal: {pose: {position: {x: 100, y: 500}}}}"
# {plan: {header: {stamp: {sec: 2}}, poses: []}}

# Progress and cancellation of a long request. First terminal:
ros2 service call /gp_sampler/generate rcl_interfaces/srv/SetParametersAtomically "{parameters: [{name: request, value: {type: 4, string_value: large}}, {name: count, value: {type: 2, integer_value: 100000}}]}"
# {result: {successful: false, reason: 'request large: cancelled'}}
# second terminal: `progress` has the values request, requested, accepted, candidates, seconds, and who waits
ros2 topic echo /diagnostics --filter "any(s.name == '/gp_sampler: progress' for s in m.status)"
# third terminal
ros2 service call /gp_sampler/cancel_request rcl_interfaces/srv/SetParametersAtomically "{parameters: [{name: request, value: {type: 4, string_value: large}}]}"
# {result: {successful: true, reason: 'request large is cancelled, … of 100000 scenarios were found'}}

# With ros2 run scenario_gen player --ros-args -p bag:=$LOG -p paused:=true
ros2 service call /player/resume_playing std_srvs/srv/Trigger
# {success: true, message: playing}
ros2 service call /player/pause_playing std_srvs/srv/Trigger
# {success: true, message: paused}
