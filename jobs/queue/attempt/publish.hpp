// From a folder of work to a bank in the store.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "jobs/store/outcome/outcome.hpp"
#include "jobs/front/report/report.hpp"
#include "jobs/store/records.hpp"
#include "jobs/store/store.hpp"

namespace carillon::attempt {

/// What is wrong with the bank in the folder of work, or with the files of a simulation, in one sentence; none when it is whole and sane
/// and was made of that request. `has_bank` says whether there is one.
std::optional<std::string> find_bank_fault(const std::filesystem::path& work, const store::Request& request, bool& has_bank);

/// Why one of the records next to a bank in the store (job.json, request.json, outcome.json) is not what was published, or not that of this
/// job, in one sentence; none when all are.
std::optional<std::string> find_record_fault(const store::Store& store, const store::Id& id);

/// Writes those records again: from the request, and from the copy of job.json that the bank holds. False when the bank holds none, or was
/// not made of that request. SystemError when the disk refuses.
bool repair_records(const store::Store& store, const store::Request& request);

/// Puts bank, resolved job, request, log, outcome and a report (titled by the job's input) from the folder of work into one folder and
/// publishes it as the bank of `id`; nothing is taken from the folder of work before that. SystemError when the disk refuses: nothing is
/// published then.
void publish(const store::Store& store, const store::Id& id, const std::filesystem::path& work, const outcome::Outcome& outcome,
             report::Options wanted);

/// Makes sure that `name` in the folder of work is a regular file with no other name, or not there: anything else goes.
void clear_way(const std::filesystem::path& work, const std::string& name);

/// A file that keeps some room on the disk, so that the end of an attempt can be written when the disk is full. Without effect where there
/// is no room already.
void make_reserve(const std::filesystem::path& work);
void remove_reserve(const std::filesystem::path& work);

}  // namespace carillon::attempt
