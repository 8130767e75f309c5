// Current step of the process, for messages on fatal signals. Internal header; guard_program() is in surface.hpp.
#pragma once

#include <string_view>

namespace carillon::mesher {

/// Current step and file. No effect unless guard_program() was called, as for the others here.
void set_guarded_step(std::string_view file, std::string_view step);

/// During its lifetime, limits the further processor time of the process.
class CpuLimit {
 public:
  explicit CpuLimit(double seconds);
  ~CpuLimit();
  CpuLimit(const CpuLimit&) = delete;
  CpuLimit& operator=(const CpuLimit&) = delete;

 private:
  bool set_ = false;
  unsigned long before_ = 0;
};

}  // namespace carillon::mesher
