// Were all ranks of a run started for the same work?
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::run {

/// What this rank was given of something that all ranks must have alike.
struct Given {
  std::string shown;               // in messages
  std::vector<std::string> forms;  // two ranks have the same when they agree in one of them; empty: not known on this rank
};

/// A job file by its content, where this rank can read it; elsewhere the job of rank 0 counts.
Given look_at_job(const std::filesystem::path& file, std::uint64_t max_bytes);
/// A file by its absolute path, or by where links lead.
Given look_at_place(const std::filesystem::path& file);

/// Throws InputError on all ranks alike where one was given another `what` ("job", "bank") than rank 0: they were started one by one by a
/// program under mpirun, for work of their own, and would silently do that of rank 0. Collective.
void check_same(const comm::Communicator& comm, const std::string& what, const Given& given);

}  // namespace carillon::run
