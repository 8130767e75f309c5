// Suppresses library output.
#pragma once

#include <memory>

namespace carillon::mesher {

/// During its lifetime, CGAL warnings and output to std::cerr and std::clog are discarded; CGAL errors still throw. One at a time.
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
