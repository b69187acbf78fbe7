// SPDX-FileCopyrightText: 2026 The scenario_gen authors
// SPDX-License-Identifier: Apache-2.0

// What the C++ example uses of rclcpp: `spin` sends an empty scenario, one without velocities and one with them.

#ifndef RCLCPP__RCLCPP_HPP_
#define RCLCPP__RCLCPP_HPP_

#include <cstdio>
#include <functional>
#include <memory>
#include <string>

#include "builtin_interfaces/msg/duration.hpp"
#include "trajectory_msgs/msg/multi_dof_joint_trajectory.hpp"

#define RCLCPP_INFO(logger, ...) ((void)(logger), std::printf(__VA_ARGS__), std::puts(""))

namespace rclcpp
{
using Message = trajectory_msgs::msg::MultiDOFJointTrajectory;

struct KeepLast
{
  explicit KeepLast(size_t depth)
  : depth(depth) {}
  size_t depth;
};

struct QoS
{
  explicit QoS(const KeepLast &) {}
  QoS & reliable() {return *this;}
  QoS & transient_local() {return *this;}
};

struct Duration
{
  explicit Duration(const builtin_interfaces::msg::Duration & message)
  : seconds_(message.sec + 1e-9 * message.nanosec) {}
  double seconds() const {return seconds_;}
  double seconds_;
};

template<typename T>
struct Subscription
{
  using SharedPtr = std::shared_ptr<Subscription>;
  std::function<void(const T &)> callback;
};

class Node
{
public:
  explicit Node(const std::string &) {}
  template<typename T, typename Callback>
  typename Subscription<T>::SharedPtr create_subscription(
    const std::string &, const QoS &, Callback callback)
  {
    callback_ = callback;
    return std::make_shared<Subscription<T>>(Subscription<T>{callback});
  }
  int get_logger() const {return 0;}
  std::function<void(const Message &)> callback_;
};

inline void init(int, char **) {}
inline void shutdown() {}
inline void spin(std::shared_ptr<Node> node)
{
  Message scenario;
  node->callback_(scenario);
  scenario.header.frame_id = "map";
  scenario.joint_names = {"1:4.5x1.8:car"};
  scenario.points.resize(1);
  scenario.points[0].transforms.resize(1);
  scenario.points[0].time_from_start.sec = 3;
  node->callback_(scenario);
  scenario.points[0].velocities.resize(1);
  scenario.points[0].velocities[0].linear.x = 7.0;
  node->callback_(scenario);
}
}  // namespace rclcpp

#endif  // RCLCPP__RCLCPP_HPP_
