// The step at which a process is, for what it says when a signal ends it. Inner header; guard_program() is in surface.hpp.
#pragma once

#include <string_view>

namespace carillon::mesher {

/// What is being done to which file. Nothing unless guard_program() was called, as the others here.
void set_guarded_step(std::string_view file, std::string_view step);

/// During its lifetime, the process ends after this much more processor time.
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
