// SPDX-FileCopyrightText: 2026 The scenario_gen authors
// SPDX-License-Identifier: Apache-2.0

// Prints each message of `scenarios`: its vehicles, its duration, and where each vehicle ends.
// The topic is latched: a late listener receives the last 1000. docs/interfaces.md explains the fields.

#include <memory>

#include "rclcpp/rclcpp.hpp"
#include "trajectory_msgs/msg/multi_dof_joint_trajectory.hpp"

using Trajectory = trajectory_msgs::msg::MultiDOFJointTrajectory;

class ScenarioListener : public rclcpp::Node
{
public:
  ScenarioListener()
  : Node("scenario_listener")
  {
    const auto quality = rclcpp::QoS(rclcpp::KeepLast(1000)).reliable().transient_local();
    subscription_ = create_subscription<Trajectory>(
      "scenarios", quality, [this](const Trajectory & scenario) {receive(scenario);});
  }

private:
  void receive(const Trajectory & scenario) const
  {
    if (scenario.points.empty()) {
      return;
    }
    const auto & last = scenario.points.back();
    const double duration_s = rclcpp::Duration(last.time_from_start).seconds();
    RCLCPP_INFO(
      get_logger(), "%zu vehicles for %.1f s in %s", scenario.joint_names.size(), duration_s,
      scenario.header.frame_id.c_str());
    for (size_t n = 0; n < scenario.joint_names.size(); ++n) {  // <id>:<length>x<width>:<type>
      const auto & position = last.transforms.at(n).translation;
      RCLCPP_INFO(
        get_logger(), "  %s ends at (%.1f, %.1f) m", scenario.joint_names[n].c_str(), position.x,
        position.y);
      if (n < last.velocities.size()) {  // they are optional
        RCLCPP_INFO(get_logger(), "    with %.1f m/s", last.velocities[n].linear.x);
      }
    }
  }

  rclcpp::Subscription<Trajectory>::SharedPtr subscription_;
};

int main(int argc, char ** argv)
{
  rclcpp::init(argc, argv);
  rclcpp::spin(std::make_shared<ScenarioListener>());
  rclcpp::shutdown();
}
