// Command line and environment of this process as others see them in /proc.
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace carillon::worker {

/// The memory in which the kernel put the words of main() and the entry CARILLON_ATTEMPT of the environment. Forks overwrite their copies.
class Title {
 public:
  /// First in main(): setenv() moves entries.
  Title(int argc, char** argv);

  /// Shows these words; those that do not fit are cut off. `name`: of the thread, at most 15 characters.
  void show(const char* name, const std::vector<std::string>& words) const;
  /// Shows the token of an attempt, if it is as long as the one that it replaces.
  void show_token(std::string_view token) const;

 private:
  char *words_ = nullptr, *words_end_ = nullptr, *token_ = nullptr;
};

}  // namespace carillon::worker
