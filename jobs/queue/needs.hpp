// Resource needs of a job: requested, predicted by the solver, or estimated from its size.
#pragma once

#include "jobs/queue/admission.hpp"
#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"
#include "precompute/job/cost/problem_size.hpp"

namespace carillon::queue {

struct JobNeeds {
  Need need;
  double time_limit_s = 0.0;
  bool wants_prediction = false;  // too large to estimate, and no memory requested
  bool is_simulation = false;
};

/// From request.json and prediction.json of the job's folder; damaged files are ignored.
JobNeeds find_needs(const store::Store& store, const registry::Job& job);

/// Updates the requests from the row.
void set_asked(JobNeeds& needs, const registry::Job& job);

/// Estimate from the problem size by the cost model.
Need guess_need(const cost::ProblemSize& size);

}  // namespace carillon::queue
