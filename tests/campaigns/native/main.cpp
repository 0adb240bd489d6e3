// Runs random cases on the core under sanitizers: ``fuzz --first N --cases M [--seed S] [--mark FILE]``.
//
// Which part a case goes to depends on its number alone, what it does on the seed and the number. The number of the
// case at work stands in the file, so that it is known after a finding has ended the process. A case that takes
// kCaseSeconds of processor time hangs, and ends the process as well.
#include <fcntl.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string>

#include "targets.hpp"

namespace {

constexpr int kCaseSeconds = 20;

struct Target {
    const char* name;
    void (*run)(fuzz::Random&);
    int share;  // of 100 cases
};

constexpr std::array<Target, 16> kTargets{{{"evolve", fuzz::evolve, 34},
                                           {"rasterize", fuzz::rasterize, 12},
                                           {"edges", fuzz::edges, 10},
                                           {"march", fuzz::march, 5},
                                           {"level_set", fuzz::level_set, 5},
                                           {"outlines", fuzz::outlines, 4},
                                           {"snake", fuzz::snake, 8},
                                           {"cyclic", fuzz::cyclic, 2},
                                           {"nearest", fuzz::nearest, 3},
                                           {"scores", fuzz::scores, 4},
                                           {"alignment", fuzz::alignment, 3},
                                           {"interest", fuzz::interest, 2},
                                           {"features", fuzz::features, 2},
                                           {"ways", fuzz::ways, 2},
                                           {"forest", fuzz::forest, 2},
                                           {"path_text", fuzz::path_text, 2}}};

struct Options {
    unsigned long long seed = 0, first = 0, cases = 1;
    std::string mark = "/dev/null";
};

struct Count {
    unsigned long long cases = 0, slowest_case = 0;
    double seconds = 0.0, slowest = 0.0;
};

Options parse(int argc, char** argv) {
    Options options;
    for (int i = 1; i + 1 < argc; i += 2) {
        const std::string name = argv[i];
        if (name == "--seed") options.seed = std::strtoull(argv[i + 1], nullptr, 10);
        if (name == "--first") options.first = std::strtoull(argv[i + 1], nullptr, 10);
        if (name == "--cases") options.cases = std::strtoull(argv[i + 1], nullptr, 10);
        if (name == "--mark") options.mark = argv[i + 1];
    }
    return options;
}

// Neighbouring numbers go to different targets; 37 and 100 have no common factor.
std::size_t target_of(unsigned long long number) {
    int place = static_cast<int>(number * 37 % 100);
    std::size_t target = 0;
    while (place >= kTargets[target].share) place -= kTargets[target++].share;
    return target;
}

double processor_seconds() {
    timespec now{};
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
    return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

void hangs(int) {
    constexpr char kText[] = "hang: the case takes too long\n";
    if (write(STDERR_FILENO, kText, sizeof kText - 1) < 0) _exit(2);
    std::abort();  // with the stack, by the sanitizer
}

void watch() {
    const itimerval limit{{0, 0}, {kCaseSeconds, 0}};
    setitimer(ITIMER_PROF, &limit, nullptr);
}

void run_case(const Options& options, unsigned long long number, int mark, Count& count) {
    char text[32];
    const int size = std::snprintf(text, sizeof text, "%20llu\n", number);
    if (pwrite(mark, text, static_cast<std::size_t>(size), 0) < 0) std::abort();
    watch();
    const double begin = processor_seconds();
    fuzz::Random random(options.seed, number);
    kTargets[target_of(number)].run(random);
    const double seconds = processor_seconds() - begin;
    ++count.cases;
    count.seconds += seconds;
    if (seconds <= count.slowest) return;
    count.slowest = seconds;
    count.slowest_case = number;
}

}  // namespace

int main(int argc, char** argv) {
    const Options options = parse(argc, argv);
    const int mark = open(options.mark.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
    if (mark < 0) {
        std::perror(options.mark.c_str());
        return 2;
    }
    std::signal(SIGPROF, hangs);
    std::array<Count, kTargets.size()> counts{};
    for (unsigned long long number = options.first; number < options.first + options.cases; ++number) {
        run_case(options, number, mark, counts[target_of(number)]);
    }
    for (std::size_t t = 0; t < counts.size(); ++t) {
        std::printf("%s %llu %.3f %.3f %llu\n", kTargets[t].name, counts[t].cases, counts[t].seconds, counts[t].slowest,
                    counts[t].slowest_case);
    }
    return 0;
}
