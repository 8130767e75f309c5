// Source: Linux proc(5), /proc/PID/cmdline and environ; prctl(2) (PR_SET_NAME).
#include "jobs/queue/worker/title.hpp"

#include <sys/prctl.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>

namespace carillon::worker {

Title::Title(int argc, char** argv) : token_(std::getenv("CARILLON_ATTEMPT")) {
  if (argc == 0) return;
  words_ = argv[0];
  words_end_ = argv[argc - 1] + std::strlen(argv[argc - 1]) + 1;
}

void Title::show(const char* name, const std::vector<std::string>& words) const {
  ::prctl(PR_SET_NAME, name);
  std::string text;
  for (const std::string& word : words) text += word + '\0';
  const auto room = static_cast<std::size_t>(words_end_ - words_);
  if (room == 0) return;
  text.resize(room, '\0');
  text.back() = '\0';
  std::copy(text.begin(), text.end(), words_);
}

void Title::show_token(std::string_view token) const {
  if (token_ != nullptr && std::strlen(token_) == token.size()) std::copy(token.begin(), token.end(), token_);
}

}  // namespace carillon::worker
