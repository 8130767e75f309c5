// Checks and publication of the results of an attempt.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "jobs/front/report/report.hpp"
#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/records.hpp"
#include "jobs/store/store.hpp"

namespace carillon::attempt {

/// Fault of the bank (or of the files of a simulation) in a folder of work, in one sentence; none if it is complete, valid and belongs to
/// the request. `has_bank`: set to whether the file exists.
std::optional<std::string> find_bank_fault(const std::filesystem::path& work, const store::Request& request, bool& has_bank);

/// Fault of the records next to a bank in the store (job.json, request.json, outcome.json), in one sentence; none if all are those
/// published for this job.
std::optional<std::string> find_record_fault(const store::Store& store, const store::Id& id);

/// Writes those records again, from the request and from the provenance in the bank. False if the bank has none, or one of another request.
/// SystemError when the disk refuses.
bool repair_records(const store::Store& store, const store::Request& request);

/// Links or copies bank, resolved job, request and log of a folder of work into a new folder, adds outcome and report (titled by the job's
/// input), and publishes it as the bank of `id`. The folder of work stays unchanged. SystemError when the disk refuses: nothing is
/// published.
void publish(const store::Store& store, const store::Id& id, const std::filesystem::path& work, const outcome::Outcome& outcome,
             report::Options wanted);

/// A file of 64 kB that is removed at the end of an attempt, so that outcome.json can be written on a full disk. Best effort.
void make_reserve(const std::filesystem::path& work);
void remove_reserve(const std::filesystem::path& work);

}  // namespace carillon::attempt
