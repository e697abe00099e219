.PHONY: demo test

demo:
	python3 -m hsplat_cli.bootstrap demo

test:
	python3 -m hsplat_cli.bootstrap test
