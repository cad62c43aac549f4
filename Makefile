# Everything a person needs: `make demo` and `make test` work on a bare Debian 12 with git, make, a
# compiler and Python. A second run does only what is needed.
PYTHON ?= python3
VENV := .venv
BIN := $(VENV)/bin
JOBS ?= $(shell nproc)

.PHONY: demo test lint-and-test-cpp last-checks bench lint types stubs docs format sanitize stress fuzz-maps tidy wheel test-wheel compare-wheel test-arm \
  test-demo install developer python clean test-cpp test-python help always

help:
	@echo "make demo      install what is needed, run the demonstration"
	@echo "make test      all tests: C++, Python, lint, types"
	@echo "make docs      the documentation site, in build/site"
	@echo "make bench     measure, and compare with the reference's figures where they are known"
	@echo "make sanitize  C++ tests under the address, undefined-behaviour and thread sanitizers"
	@echo "make stress    ten minutes of all threads at random under the thread sanitizer"
	@echo "make fuzz-maps 20 000 spoilt map files under the address and undefined-behaviour sanitizers"
	@echo "make test-demo make demo on a bare Debian (chroot, needs root)"
	@echo "make wheel     build dist/*.whl, which needs nothing of the system, and check it"
	@echo "make test-wheel  install the wheel on a bare Debian (chroot, needs root) and use it"
	@echo "make compare-wheel  the wheel's results beside those of the package built from source"
	@echo "make test-arm  the C++ core and its tests for arm64, run by an emulator"
	@echo "make format    apply clang-format and ruff"

# ---- environment ---------------------------------------------------------------------------------
# Each job uses all processors by itself, and two must not install into the same place.
.NOTPARALLEL:
# Packages of the shell's environment (ROS sets it) would be taken for those of ours.
unexport PYTHONPATH PYTHONHOME

# Sections of scripts/system_packages.txt; looked at every time, which takes a moment.
packages-%: ; @scripts/install_system_packages.sh $(subst +, ,$*)

python:
	@command -v $(PYTHON) >/dev/null || { echo "There is no $(PYTHON): install Python 3.10 or later," \
	  "or name one: make demo PYTHON=python3.11" >&2; exit 1; }
	@$(PYTHON) scripts/make_venv.py $(VENV) --only-check-python

# Made anew where it does not work: Python was upgraded, the checkout was moved.
$(VENV)/pyvenv.cfg: always | python packages-package
	@$(PYTHON) scripts/make_venv.py $(VENV) $(if $(filter-out file,$(origin PYTHON)),--this-python)

$(VENV)/.%-requirements: pyproject.toml $(VENV)/pyvenv.cfg
	@$(BIN)/python scripts/install_requirements.py $*
	@touch $@

CPP_SOURCES := $(shell find src/cpp cmake -name '*.cpp' -o -name '*.hpp' -o -name '*.cmake' \
  -o -name CMakeLists.txt) CMakeLists.txt
CYTHON_SOURCES := $(shell find src/orbslam2py -name '*.pyx')

# The names of the package's files: an installation for development knows them.
build/.names: always
	@mkdir -p build
	@find src/orbslam2py -name __pycache__ -prune -o -type f ! -name '*.so' -print | sort >$@.new
	@if cmp -s $@.new $@; then rm $@.new; else mv $@.new $@; fi

# The package, installed for development: Python files are used from src, extensions from build.
$(VENV)/.installed: $(VENV)/.build-requirements build/.names $(CPP_SOURCES) $(CYTHON_SOURCES)
	@$(BIN)/python scripts/build_package.py $(if $(filter-out file,$(origin JOBS)),--jobs $(JOBS))
	@touch $@

always:

install: $(VENV)/.installed

developer: $(VENV)/.developer-requirements

# ---- the main job --------------------------------------------------------------------------------
demo: install
	@$(BIN)/orbslam2py demo

# On a bare Debian (chroot, needs root).
test-demo: | packages-bare-tree
	@$(PYTHON) scripts/test_demo.py || [ $$? -eq 77 ] # 77: not possible here

# ---- tests ---------------------------------------------------------------------------------------
TYPES := $(BIN)/mypy
STUBS := $(BIN)/python scripts/generate_stubs.py --check
DOCS := NO_MKDOCS_2_WARNING=1 $(BIN)/python -m mkdocs build --strict --quiet

# All packages at once; each of the others installs its own if it is called alone.
test: packages-package+cpp-tests+lint+docs+browser+cameras lint-and-test-cpp test-python last-checks
	@echo "All tests passed."

# Python packages are downloaded while the compiler works.
lint-and-test-cpp:
	@printf '%s\n' lint test-cpp | xargs -P 2 -n 1 $(MAKE) --no-print-directory

# Each of them uses one processor.
last-checks: install developer | packages-docs
	@printf '%s\n' '$(TYPES)' '$(STUBS)' '$(DOCS)' | xargs -d '\n' -P $(JOBS) -n 1 sh -c

test-cpp: | packages-package+cpp-tests
	@mkdir -p build
	@cmake --preset release >build/configure.log || { cat build/configure.log; exit 1; }
	@cmake --build build/release -j $(JOBS)
	@ctest --test-dir build/release --output-on-failure -j $(JOBS)

test-python: install developer | packages-package+browser+docs+cameras
	@$(BIN)/python -m pytest -q -n $(JOBS) --dist loadfile --no-loadscope-reorder

lint: developer | packages-lint
	@mkdir -p build
	@$(BIN)/ruff check src tests examples benchmarks scripts
	@$(BIN)/ruff format --check src tests examples benchmarks scripts
	@PYTHONPATH=src $(BIN)/lint-imports --no-cache >build/lint-imports.log || { cat build/lint-imports.log; exit 1; }
	@find src/cpp tests/cpp benchmarks -name '*.cpp' -o -name '*.hpp' | xargs clang-format --dry-run -Werror

types: install developer
	@$(TYPES)

# The stubs of the C++ extension are part of the source; they must say what the build says.
stubs: install developer
	@$(STUBS)

# The documentation site; a warning fails.
docs: install developer | packages-docs
	@$(DOCS)
	@echo "The documentation is in build/site/index.html."

# Slow (minutes), so not part of `make test`. clang cannot read the headers that GCC has compiled, and knows not all
# of its options; each source is looked at by itself. TIDY names a folder or a source where not all are wanted.
TIDY ?= src/cpp
tidy: | packages-package+cpp-tests+tidy
	@cmake --preset release -B build/tidy -DORBSLAM2PY_UNITY=OFF -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON >/dev/null
	@find $(TIDY) -name '*.cpp' -not -path '*/bindings/*' | xargs -P $(JOBS) -n 1 \
	  clang-tidy -p build/tidy --quiet --extra-arg=-Wno-unused-command-line-argument

sanitize: | packages-package+cpp-tests
	@cmake --preset asan >/dev/null && cmake --build build/asan -j $(JOBS)
	@ctest --test-dir build/asan --output-on-failure -j $(JOBS)
	@cmake --preset tsan >/dev/null && cmake --build build/tsan -j $(JOBS) --target thread_driver
	@build/tsan/tests/cpp/thread_driver --seconds 15

# The whole system in threads, disturbed at random, under the thread sanitizer.
STRESS_SECONDS ?= 600
stress: | packages-package+cpp-tests
	@cmake --preset tsan >/dev/null && cmake --build build/tsan -j $(JOBS) --target thread_driver
	@build/tsan/tests/cpp/thread_driver --seconds $(STRESS_SECONDS)

# Spoilt map files, read by Python with an extension that was built with sanitizers. `make sanitize`
# spoils what the extension gets; this spoils the files. FUZZ_FIRST goes on where a run has ended.
FUZZ_RUNS ?= 20000
FUZZ_FIRST ?= 0
SANITIZED := build/asan-ext
fuzz-maps: install developer
	@cmake --preset asan -B $(SANITIZED) -DORBSLAM2PY_TESTS=OFF -DORBSLAM2PY_PYTHON=ON \
	  -DPython_EXECUTABLE=$(CURDIR)/$(BIN)/python \
	  -Dpybind11_DIR=$$($(BIN)/python -m pybind11 --cmakedir) >$(SANITIZED).log || { cat $(SANITIZED).log; exit 1; }
	@cmake --build $(SANITIZED) -j $(JOBS) --target orbslam2py_python
	@$(BIN)/python scripts/package_with_extensions.py $(SANITIZED) $(SANITIZED)/package
	@LD_PRELOAD="$$($${CXX:-c++} -print-file-name=libasan.so) $$($${CXX:-c++} -print-file-name=libstdc++.so)" \
	  ASAN_OPTIONS=detect_leaks=0 UBSAN_OPTIONS=halt_on_error=1:print_stacktrace=1 \
	  PYTHONPATH=$(SANITIZED)/package:.:$$($(BIN)/python -c 'import sysconfig; print(sysconfig.get_path("purelib"))') \
	  $(BIN)/python -S -m benchmarks.map_files.mutations \
	  --runs $(FUZZ_RUNS) --first $(FUZZ_FIRST)

# ---- the rest ------------------------------------------------------------------------------------
# BEFORE names a commit: it is built as well, and its kernels run in turns with ours.
bench: install developer | packages-package+cpp-tests
	@cmake --preset release >/dev/null && cmake --build build/release -j $(JOBS) --target benchmarks
	@$(BIN)/python -m benchmarks.speed.compare
	@$(BIN)/python -m benchmarks.versions $(if $(BEFORE),--before $(BEFORE))

# A wheel for the Python that is named, with all libraries inside: minutes the first time, as it builds
# Ceres and OpenCV. `make test-wheel` tries it on a bare Debian, which needs root.
wheel: | packages-wheel
	@$(PYTHON) scripts/wheel/build_wheel.py --jobs $(JOBS)

WHEEL_SUITE ?= bookworm
test-wheel: | packages-bare-tree
	@$(PYTHON) scripts/wheel/test_wheel.py dist --suite $(WHEEL_SUITE) || [ $$? -eq 77 ] # 77: not possible here

compare-wheel: install developer
	@$(BIN)/python scripts/wheel/compare_builds.py dist

# The core for another processor: libraries are unpacked into build/arm, nothing of arm64 is installed. With
# ARM_TESTS=all also the tests that take the emulator long.
ARM_TESTS ?= chosen
test-arm: | packages-package+cpp-tests+arm
	@mkdir -p build/arm
	@scripts/arm/test_arm.sh build/arm $(JOBS) $(ARM_TESTS)

format: developer | packages-lint
	@$(BIN)/ruff check --fix-only src tests examples benchmarks scripts
	@$(BIN)/ruff format src tests examples benchmarks scripts
	@find src/cpp tests/cpp benchmarks -name '*.cpp' -o -name '*.hpp' | xargs clang-format -i

clean:
	rm -rf build dist $(VENV)
