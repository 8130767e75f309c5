// Check that all ranks have the same input.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::run {

/// This rank's value of an input that must be equal on all ranks.
struct Given {
  std::string shown;               // in messages
  std::vector<std::string> forms;  // equal on two ranks if one form is equal; empty: unknown on this rank
};

/// A job file by its content; if unreadable on this rank, rank 0's counts.
Given look_at_job(const std::filesystem::path& file, std::uint64_t max_bytes);
/// A file by its absolute path or by its path with links resolved.
Given look_at_place(const std::filesystem::path& file);

/// Throws InputError on all ranks if the `what` ("job", "bank") of one differs from rank 0's, as when an MPI program starts independent
/// solvers on its ranks: they would all silently do rank 0's work. Collective.
void check_same(const comm::Communicator& comm, const std::string& what, const Given& given);

}  // namespace carillon::run
