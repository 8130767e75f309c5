// Check that all ranks of a run have the same work.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::run {

/// This rank's value of an input that must be equal on all ranks.
struct Given {
  std::string shown;               // in messages
  std::vector<std::string> forms;  // equal on two ranks if one form is; empty: unknown on this rank
};

/// A job file by its content; unreadable on this rank: the job of rank 0 counts.
Given look_at_job(const std::filesystem::path& file, std::uint64_t max_bytes);
/// A file by its absolute path, or by its path with links resolved.
Given look_at_place(const std::filesystem::path& file);

/// Throws InputError on all ranks if the `what` ("job", "bank") of one differs from rank 0's: started one by one by a program under mpirun,
/// for work of their own, they would silently do that of rank 0. Collective.
void check_same(const comm::Communicator& comm, const std::string& what, const Given& given);

}  // namespace carillon::run
