#include "plan/plan.hpp"
#include "report/html.hpp"
