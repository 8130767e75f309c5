// Messages of the C interface in the examples with physics engines. C++14.
#pragma once

#include <carillon.h>

#include <cstddef>
#include <cstdio>
#include <cstdlib>

/// Ends the program with the message of a call that failed.
class Message {
 public:
  char* text() { return text_; }
  static constexpr std::size_t size() { return sizeof text_; }
  void check(carillon_status status) const {
    if (status == CARILLON_OK) return;
    std::fprintf(stderr, "%s: %s\n", carillon_status_text(status), text_);
    std::exit(1);
  }

 private:
  char text_[512] = "";
};
