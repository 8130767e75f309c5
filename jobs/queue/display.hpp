// What `carillon run` tells: a bar on a terminal, JSON lines elsewhere.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "jobs/registry/registry.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

class Display {
 public:
  Display(bool json, bool quiet);
  ~Display();

  /// A job was started, ended, or waits: one line. `event`: "start", "predict", "adopt", "done", "failed", "cancelled", "waiting",
  /// "queued".
  void tell(const std::string& event, const registry::Job& job, const std::vector<std::string>& warnings = {});
  /// Something about the whole run: one line.
  void say(const std::string& text);
  /// How far everything is: the bar, or a line for each job that got further.
  void show(const store::Store& store, const std::vector<registry::Job>& jobs);

 private:
  void clear();
  void print(const std::string& line);

  bool json_ = false, quiet_ = false, is_terminal_ = false;
  bool has_bar_ = false;
  std::map<std::string, double> told_percent_;
  std::size_t ended_ = 0;
};

}  // namespace carillon::queue
