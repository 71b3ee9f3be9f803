// SPDX-License-Identifier: MIT
// The adapter to ros2_control: names, parameters and states of the lifecycle. drive.cpp makes all decisions.
#include <array>
#include <string>
#include <vector>

#include "hardware_interface/system_interface.hpp"
#include "hardware_interface/types/hardware_interface_type_values.hpp"
#include "iwheel_hardware/drive.hpp"
#include "pluginlib/class_list_macros.hpp"
#include "rclcpp/logging.hpp"

namespace iwheel_hardware
{

class System : public hardware_interface::SystemInterface
{
public:
  using Result = hardware_interface::CallbackReturn;
  using Return = hardware_interface::return_type;

  Result on_init(const hardware_interface::HardwareComponentInterfaceParams & params) override
  {
    if (SystemInterface::on_init(params) != Result::SUCCESS) {
      return Result::ERROR;
    }
    if (info_.joints.size() != SIDES) {
      return report("the URDF must have two joints, the left wheel first");
    }
    for (const auto & joint : info_.joints) {
      if (joint.command_interfaces.size() != 1 || joint.command_interfaces[0].name != hardware_interface::HW_IF_VELOCITY) {
        return report(joint.name + " must have one command interface: velocity");
      }
    }
    return Result::SUCCESS;
  }

  Result on_configure(const rclcpp_lifecycle::State &) override
  {
    return drive_.open(parameter("socket", "")) ? Result::SUCCESS : report(drive_.error());
  }

  Result on_activate(const rclcpp_lifecycle::State &) override
  {
    for (const auto & joint : info_.joints) {  // A command from before the activation must not act.
      set_command(joint.name + "/" + hardware_interface::HW_IF_VELOCITY, 0.0);
    }
    return drive_.activate(parameter("name", "ros2_control")) ? Result::SUCCESS : report(drive_.error());
  }

  Result on_deactivate(const rclcpp_lifecycle::State &) override
  {
    return drive_.deactivate() ? Result::SUCCESS : report(drive_.error());
  }

  Result on_cleanup(const rclcpp_lifecycle::State &) override { return end(); }
  Result on_shutdown(const rclcpp_lifecycle::State &) override { return end(); }
  Result on_error(const rclcpp_lifecycle::State &) override { return end(); }

  Return read(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    std::array<Wheel, SIDES> wheels;
    if (!drive_.read(wheels)) {
      (void)report(drive_.error());
      return Return::ERROR;
    }
    for (size_t side = 0; side < SIDES; side++) {
      const std::string & joint = info_.joints[side].name;
      set_state(joint + "/" + hardware_interface::HW_IF_POSITION, wheels[side].position_rad);
      set_state(joint + "/" + hardware_interface::HW_IF_VELOCITY, wheels[side].velocity_rad_s);
    }
    return Return::OK;
  }

  Return write(const rclcpp::Time &, const rclcpp::Duration &) override
  {
    if (drive_.state() != Drive::State::ACTIVE) {
      return Return::OK;  // Inactive hardware gets no commands.
    }
    std::array<double, SIDES> rad_s;
    for (size_t side = 0; side < SIDES; side++) {
      rad_s[side] = get_command(info_.joints[side].name + "/" + hardware_interface::HW_IF_VELOCITY);
    }
    if (!drive_.write(rad_s)) {
      (void)report(drive_.error());
      return Return::ERROR;
    }
    return Return::OK;
  }

private:
  Result end()
  {
    drive_.close();
    return Result::SUCCESS;
  }

  Result report(const std::string & why)
  {
    RCLCPP_ERROR(rclcpp::get_logger("iwheel_hardware"), "%s", why.c_str());
    return Result::ERROR;
  }

  std::string parameter(const std::string & name, const std::string & otherwise) const
  {
    const auto found = info_.hardware_parameters.find(name);
    return found != info_.hardware_parameters.end() ? found->second : otherwise;
  }

  Drive drive_;
};

}  // namespace iwheel_hardware

PLUGINLIB_EXPORT_CLASS(iwheel_hardware::System, hardware_interface::SystemInterface)
