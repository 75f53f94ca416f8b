# Every target sets up by itself (scripts/setup.sh); nothing needs to be installed or activated first.
BIN := .venv/bin
# Test files run side by side, each on one core.
# A worker that crashes ends the run: pytest-xdist may wait for ever for the tests that a new one is given.
PYTEST := OMP_NUM_THREADS=1 $(BIN)/pytest --numprocesses=auto --maxprocesses=4 --dist=loadfile --max-worker-restart=0
.DEFAULT_GOAL := help
# Of compiled modules LeRobot is imported in six seconds, otherwise in fifteen, by every program that a test starts.
unexport PYTHONDONTWRITEBYTECODE
.PHONY: help setup watch demo expert-reports test test-slow test-all fuzz mujoco check format bench docs lock build clean

help:  ## List the targets
	@awk -F ':.*## ' '/^[a-z-]+:.*## / { printf "  make %-10s %s\n", $$1, $$2 }' $(MAKEFILE_LIST)

setup:  ## Make .venv: Python 3.12, pinned packages, ours editable
	@scripts/setup.sh

WATCH := outputs/watch
TASK := lift_tray
watch: setup  ## Watch a trained policy at work: videos in outputs/watch (a minute, no GPU); TASK=pick_plate is another
	$(BIN)/lerobot-bimanual-eval --policy.path=results/checkpoints/peract2_on_all --policy.device=cpu \
	    --env.task=$(TASK) --env.image_size=128 --env.video_dir=$(WATCH)/videos \
	    --eval.n_episodes=4 --eval.batch_size=2 --output_dir=$(WATCH)
	@ls $(WATCH)/videos/*

demo: setup  ## Generate demonstrations, train a small PerAct2, evaluate it (minutes, no GPU)
	$(BIN)/lerobot-bimanual policy benchmark --task=lift_ball --steps=1000 --save_freq=1000 --test_episodes=20 \
	    --first_seed=1000 --device=cpu --output=outputs/demo --video_dir=$(CURDIR)/outputs/demo/videos

expert-reports: setup  ## Evaluate experts and baselines in both settings, and write docs/tasks.md (hours; it goes on where it stopped)
	scripts/expert_reports.sh

test: setup  ## Run the tests that need neither long nor a GPU (minutes)
	$(PYTEST) -m "not slow and not weekly and not gpu"

test-slow: setup  ## Run only the slow tests: whole command lines, training
	$(PYTEST) --no-loadscope-reorder -m "slow and not weekly and not gpu"

test-all: setup  ## Run every test; those for a GPU skip themselves where there is none
	$(PYTEST)

FUZZ_EXAMPLES := 1000
fuzz: setup  ## Feed every reader and action thousands of broken inputs (FUZZ_EXAMPLES of each kind)
	FUZZ_EXAMPLES=$(FUZZ_EXAMPLES) $(PYTEST) --timeout=3600 -m fuzz

mujoco: setup  ## Play every expert once with the lowest and the newest MuJoCo that may be installed (a minute)
	scripts/mujoco_versions.sh

check: setup  ## Lint, formatting, imports between packages, types
	$(BIN)/ruff check
	$(BIN)/ruff format --check
	$(BIN)/lint-imports --no-cache
	$(BIN)/pyright

format: setup  ## Sort imports and format the code
	$(BIN)/ruff check --fix
	$(BIN)/ruff format

bench: setup  ## Run the benchmarks of docs/performance.md; each ends with a line of JSON
	@for what in simulation observation; do $(BIN)/python benchmarks/world.py $$what || exit; done

docs: setup  ## Build the site of the documentation, with videos of the experts, into build/site (minutes at first)
	$(BIN)/python scripts/site_hooks.py
	NO_MKDOCS_2_WARNING=1 $(BIN)/mkdocs build
	@echo "open build/site/index.html"

lock:  ## Rewrite requirements.lock from the pyprojects (rm uv.lock first to take newer versions)
	"$$(scripts/find_uv.sh)" export --quiet --no-hashes --no-emit-workspace --all-packages --group docs \
	    --no-annotate --no-header --output-file requirements.lock

build: setup  ## Build the wheels and source archives of the four packages into dist/
	@for package in . envs policies robots; do \
	    $(BIN)/python -m build --no-isolation --outdir dist "$$package" || exit; done

clean:  ## Remove what the other targets made, except uv.lock
	rm -rf .venv .uv dist build outputs .pytest_cache .ruff_cache
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
