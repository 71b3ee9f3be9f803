// SPDX-License-Identifier: MIT
// The hardware interface's logic with the calls of ros2_control: a line of standard input is a call, a line of standard output its result.
//     open SOCKET | activate | deactivate | close | cycles COUNT LEFT RIGHT    (read and write at 50 Hz, rad/s)
#include <chrono>
#include <iostream>
#include <sstream>
#include <thread>

#include "iwheel_hardware/drive.hpp"

using iwheel_hardware::Drive;

static bool cycles(Drive & drive, int count, const std::array<double, 2> & speeds)
{
  std::array<iwheel_hardware::Wheel, 2> wheels{};
  auto due = std::chrono::steady_clock::now();
  for (int i = 0; i < count; i++) {
    if (!drive.read(wheels) || (drive.state() == Drive::State::ACTIVE && !drive.write(speeds))) {
      return false;
    }
    due += std::chrono::milliseconds(20);
    std::this_thread::sleep_until(due);
  }
  std::cout << wheels[0].position_rad << ' ' << wheels[1].position_rad << ' ' << wheels[0].velocity_rad_s << ' ' << wheels[1].velocity_rad_s << ' ';
  return true;
}

int main()
{
  Drive drive;
  for (std::string line; std::getline(std::cin, line);) {
    std::istringstream words(line);
    std::string verb, argument, left, right;
    int count = 0;
    words >> verb;
    bool good = true;
    if (verb == "open") {
      words >> argument;
      good = drive.open(argument);
    } else if (verb == "activate") {
      good = drive.activate("controllers");
    } else if (verb == "deactivate") {
      good = drive.deactivate();
    } else if (verb == "close") {
      drive.close();
    } else {
      words >> count >> left >> right;
      good = cycles(drive, count, {std::stod(left), std::stod(right)});
    }
    std::cout << (good ? "ok " : "error ") << static_cast<int>(drive.state()) << ' ' << (good ? "" : drive.error()) << std::endl;
  }
}
