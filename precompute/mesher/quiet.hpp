// Keeps libraries from talking past the program.
#pragma once

#include <memory>

namespace carillon::mesher {

/// While it lives, CGAL's warnings and what is written to std::cerr and std::clog go nowhere; CGAL's errors still throw. One at a time.
class Quiet {
 public:
  Quiet();
  ~Quiet();
  Quiet(const Quiet&) = delete;
  Quiet& operator=(const Quiet&) = delete;

 private:
  struct Saved;
  std::unique_ptr<Saved> saved_;
};

}  // namespace carillon::mesher
